define i32 @function(double %t, ptr %state, ptr %rate, ptr %p) {
%y = call ptr $N_VGetArrayPointer(ptr %state)
%out = call ptr $N_VGetArrayPointer(ptr %rate)
$lines
}
