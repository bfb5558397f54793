; Sets the control word of x86's floating-point unit and returns the one before.

define i32 @function(i32 %word) {
%place = alloca i32
call void @llvm.x86.sse.stmxcsr(ptr %place)
%before = load i32, ptr %place
store i32 %word, ptr %place
call void @llvm.x86.sse.ldmxcsr(ptr %place)
ret i32 %before
}
