; That of the residual; the masses stand behind the parameters.
define i32 @function(double %t, double %cj, ptr %state, ptr %rate, ptr %rest, ptr %matrix, ptr %p, ptr, ptr, ptr) {
%y = call ptr $N_VGetArrayPointer(ptr %state)
%out = call ptr $SUNDenseMatrix_Data(ptr %matrix)
%mass = getelementptr double, ptr %p, i64 $parameters
$lines
}
