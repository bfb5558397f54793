define i32 @function(double %t, ptr %state, ptr %rate, ptr %matrix, ptr %p, ptr, ptr, ptr) {
%y = call ptr $N_VGetArrayPointer(ptr %state)
%out = call ptr $SUNDenseMatrix_Data(ptr %matrix)
$lines
}
