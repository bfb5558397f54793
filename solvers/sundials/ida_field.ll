; The residual; the masses stand behind the parameters.
define i32 @function(double %t, ptr %state, ptr %rate, ptr %rest, ptr %p) {
%y = call ptr $N_VGetArrayPointer(ptr %state)
%slope = call ptr $N_VGetArrayPointer(ptr %rate)
%out = call ptr $N_VGetArrayPointer(ptr %rest)
%mass = getelementptr double, ptr %p, i64 $parameters
$lines
}
