; Calls any C callback many times.
define void @function(ptr %callback, i64 %calls, ptr %out, ptr %y, ptr %p) {
entry:
br label %again
again:
%done = phi i64 [0, %entry], [%next, %again]
call void %callback(ptr %out, double 0.0, ptr %y, ptr %p)
%next = add i64 %done, 1
%more = icmp slt i64 %next, %calls
br i1 %more, label %again, label %end
end:
ret void
}
