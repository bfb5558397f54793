; Groups of particles, rows of each, steps between two rows; left to itself, LLVM halves the widest registers.
define void @function(ptr noalias %states, ptr noalias %constants, i64 %steps, i64 %rows, i64 %groups)
    "prefer-vector-width"="512" {
start:
; for each constant
%c{i}_at = getelementptr double, ptr %constants, i64 {i}
%c{i}_one = load double, ptr %c{i}_at
%c{i}_first = insertelement $vector poison, double %c{i}_one, i64 0
%c{i} = shufflevector $vector %c{i}_first, $vector poison, <$width x i32> zeroinitializer
; end
br label %group
group:
%g = phi i64 [0, %start], [%next_group, %group_end]
%size = mul i64 %rows, $component
%first = mul i64 %g, %size
%at = getelementptr $vector, ptr %states, i64 %first
; for each component
%begin{i}_at = getelementptr $vector, ptr %at, i64 {i}
%begin{i} = load $vector, ptr %begin{i}_at, align 8
; end
br label %row
row:
%r = phi i64 [1, %group], [%next_row, %row_end]
; for each component
%row{i} = phi $vector [%begin{i}, %group], [$row{i}, %row_end]
; end
$before
br label %step
step:
%n = phi i64 [0, %row], [%next, %step]
; for each component
%y{i} = phi $vector [$begun{i}, %row], [$result{i}, %step]
; end
$step
%next = add i64 %n, 1
%more = icmp slt i64 %next, %steps
br i1 %more, label %step, label %row_end
row_end:
%row_first = mul i64 %r, $component
$after
; for each component
%place{i} = add i64 %row_first, {i}
%out{i} = getelementptr $vector, ptr %at, i64 %place{i}
store $vector $row{i}, ptr %out{i}, align 8
; end
%next_row = add i64 %r, 1
%another_row = icmp slt i64 %next_row, %rows
%next_group = add i64 %g, 1
%another_group = icmp slt i64 %next_group, %groups
br i1 %another_row, label %row, label %group_end
group_end:
br i1 %another_group, label %group, label %end
end:
ret void
}
