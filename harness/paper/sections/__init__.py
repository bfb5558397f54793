"""The claims of each section of the paper, a file for each, and what computes for them; imports `paper`.

Names such as `lsds` or `muassol` are labels of sections and equations in the paper's LaTeX source.
`docs/misprints.md` has the conventions of all symbols, and what printed formulas should read. L and
E stand for angular momentum and energy without St, I for moments of inertia, X for resistances to
rotation; t₂ = t/St is the slow time. "Full" runs solve the body's own equations, "averaged" or
"slow" ones those averaged over the fast rotation.
"""
