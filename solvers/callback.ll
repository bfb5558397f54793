; The field as CyRK calls it. If it is to count its calls, the address of an integer stands behind the parameters.
define void @function(ptr %out, double %t, ptr %y, ptr %p) {
; for each count
%counter_at = getelementptr double, ptr %p, i64 $parameters
%counter = load ptr, ptr %counter_at
%before = load i64, ptr %counter
%after = add i64 %before, 1
store i64 %after, ptr %counter
; end
$lines
ret void
}
