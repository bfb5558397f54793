"""C functions around traced fields, compiled by llvmlite for this processor in some 10 ms."""

import re
from dataclasses import dataclass
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from polhode.models.libraries import need
from polhode.models.once import once
from polhode.models.spent import spent_on

# Functions of C's library of one argument; the only one of two is atan2. LLVM has instructions or
# functions of its own for all others.
_UNARY = (
    *("expm1", "log1p", "tan", "asin", "acos", "atan"),
    *("sinh", "cosh", "tanh", "asinh", "acosh", "atanh"),
)
_DECLARATIONS = "declare double @atan2(double, double)\n" + "".join(
    f"declare double @{name}(double)\n" for name in _UNARY
)
# A call of one of them, whose name for long double ends in l.
_OF_LIBRARY = re.compile(rf"@({'|'.join((*_UNARY, 'atan2'))})\(")


@dataclass(frozen=True)
class MachineCode:
    """A compiled function, which lives as long as this object."""

    address: int
    engine: Any

    def function(self, prototype: Any) -> Any:
        """The function as ctypes calls it; it keeps the code alive."""
        function = prototype(self.address)
        function.code = self
        return function


def compile_file(path: Path, functions: Any = None, **fields: Any) -> MachineCode:
    """Compile a file of LLVM's language that defines ``@function``, which is returned.

    ``$name`` in the file is the field of that name or, of a library's `functions`, its address.
    Lines from ``; for each name`` to ``; end`` stand as often as that field says, a whole number,
    each time with its own ``{i}`` from 0 on.
    """

    def repeated(block: re.Match[str]) -> str:
        return "".join(block[2].replace("{i}", str(i)) for i in range(fields[block[1]]))

    text = re.sub(
        r"(?ms)^; for each (\w+)\n(.*?)^; end\n", repeated, path.read_text(encoding="utf-8")
    )
    engine = compile_text(Template(text).substitute(functions or {}, **fields))
    return MachineCode(engine.get_function_address("function"), engine)


def compile_text(text: str, level: int = 3, *, extended: bool = False) -> Any:
    """Compile definitions for this processor into an engine that knows the functions' addresses.

    `level` is LLVM's level of optimization, 0 to 3; at a lower one it takes less time. With
    `extended` every double of the text is x86's long double of 80 bits.
    """
    llvm = _llvm()
    text = _DECLARATIONS + text
    module = llvm.parse_assembly(_extended(text) if extended else text)
    target = llvm.Target.from_default_triple()
    cpu, features = _host()
    # How instructions are chosen, whatever the level of what is done to the text before.
    machine = target.create_target_machine(cpu=cpu, features=features, opt=3)
    module.data_layout = str(machine.target_data)
    passes = llvm.create_pass_builder(
        machine, llvm.create_pipeline_tuning_options(speed_level=level)
    )
    manager = passes.getModulePassManager()
    manager.run(module, passes)
    if type(manager)._dispose is llvm.ffi.ObjectRef._dispose:
        # llvmlite 0.50 forgets to free it: 50 kB.
        llvm.NewPassManager._dispose(manager)
        manager.detach()
    engine = llvm.create_mcjit_compiler(module, machine)
    engine.finalize_object()
    return engine


def _extended(text: str) -> str:
    """The text with x86's long double for double: types, constants and names of functions."""

    def constant(match: re.Match[str]) -> str:
        # LLVM writes a double as 0x and 16 digits, a long double as 0xK and 20, each with the
        # highest byte first. NumPy keeps the 10 bytes of a long double lowest first, in 16 bytes.
        value = np.frombuffer(bytes.fromhex(match[1] or "00" * 8), ">f8")[0]
        number_bytes = np.longdouble(value).tobytes()[:10]
        return "0xK" + number_bytes[::-1].hex().upper()

    # Zero alone is written as 0.0 too.
    text = re.sub(r"0x([0-9A-F]{16})|\b0\.0\b", constant, text)
    text = text.replace("double", "x86_fp80").replace(".f64(", ".f80(")
    return _OF_LIBRARY.sub(r"@\1l(", text)


def host_features() -> dict[str, bool]:
    """Features of this processor by LLVM's names, and whether it has them."""
    return _llvm().get_host_cpu_features()


@once()
def _host() -> tuple[str, str]:
    """Name and features of this processor, which take half a millisecond to find out."""
    return _llvm().get_host_cpu_name(), _llvm().get_host_cpu_features().flatten()


@once()
@spent_on("import")
def _llvm() -> Any:
    need("machine code", "llvmlite")
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm
