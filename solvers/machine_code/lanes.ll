; Groups of particles, rows of each, steps between two rows; left to itself, LLVM halves the widest registers.
declare $vector @llvm.sqrt.v${width}f64($vector)
declare $vector @llvm.sin.v${width}f64($vector)
declare $vector @llvm.cos.v${width}f64($vector)

define void @function(ptr noalias %states, ptr noalias %constants, i64 %steps, i64 %rows, i64 %groups)
    "prefer-vector-width"="512" {
start:
$constants
br label %group
group:
%g = phi i64 [0, %start], [%next_group, %group_end]
%size = mul i64 %rows, $dimension
%first = mul i64 %g, %size
%at = getelementptr $vector, ptr %states, i64 %first
$starts
br label %row
row:
%r = phi i64 [1, %group], [%next_row, %row_end]
$row
$before
br label %step
step:
%n = phi i64 [0, %row], [%next, %step]
$state
$step
%next = add i64 %n, 1
%more = icmp slt i64 %next, %steps
br i1 %more, label %step, label %row_end
row_end:
%row_first = mul i64 %r, $dimension
$after
$stores
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
