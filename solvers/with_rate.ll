; A field, and the same with one more rate behind its own: less code than that of the two apart.
define void @field(ptr %out, double %t, ptr %y, ptr %p) noinline {
$field
ret void
}

define void @function(ptr %out, double %t, ptr %y, ptr %p) {
call void @field(ptr %out, double %t, ptr %y, ptr %p)
%last = getelementptr double, ptr %out, i64 $last
$rate
ret void
}
