; A built-in function of Python around a field's lines.

; Where the data of an array are; null if it is not one-dimensional, contiguous, of float64 and of this length. Every
; object of Python begins with a head of $head bytes, the last 8 of which are the address of its type. Behind it stand
; (ndarraytypes.h, alike in NumPy 1 and 2), by their place in bytes:
;
;   of an array, `PyArrayObject`    0 data, 8 number of dimensions, 16 their lengths, 40 element type, 48 flags
;   of an element type, `PyArray_Descr`    10 character of the byte order, 12 number of the type
define internal ptr @data(ptr %array, i64 %length, i32 %flags) alwaysinline {
%behind = getelementptr i8, ptr %array, i64 $head
%type_at = getelementptr i8, ptr %behind, i64 -8
%type = load ptr, ptr %type_at
%is_array = icmp eq ptr %type, inttoptr (i64 $ndarray to ptr)
br i1 %is_array, label %typed, label %wrong
typed:
%dimensions_at = getelementptr i8, ptr %behind, i64 8
%dimensions = load i32, ptr %dimensions_at
%is_vector = icmp eq i32 %dimensions, 1
br i1 %is_vector, label %vector, label %wrong
vector:
%lengths_at = getelementptr i8, ptr %behind, i64 16
%lengths = load ptr, ptr %lengths_at
%got = load i64, ptr %lengths
%is_long = icmp eq i64 %got, %length
br i1 %is_long, label %long, label %wrong
long:
%element_at = getelementptr i8, ptr %behind, i64 40
%element = load ptr, ptr %element_at
%element_behind = getelementptr i8, ptr %element, i64 $head
%order_at = getelementptr i8, ptr %element_behind, i64 10
%order = load i8, ptr %order_at
%is_native = icmp eq i8 %order, $native
br i1 %is_native, label %ordered, label %wrong
ordered:
%number_at = getelementptr i8, ptr %element_behind, i64 12
%number = load i32, ptr %number_at
%is_double = icmp eq i32 %number, $double
br i1 %is_double, label %doubles, label %wrong
doubles:
%got_flags_at = getelementptr i8, ptr %behind, i64 48
%got_flags = load i32, ptr %got_flags_at
%data = load ptr, ptr %behind
%common = and i32 %got_flags, %flags
%usable = icmp eq i32 %common, %flags
%found = select i1 %usable, ptr %data, ptr null
ret ptr %found
wrong:
ret ptr null
}

define ptr @function(ptr %self, ptr %arguments, i64 %count) {
%few = icmp eq i64 %count, $count
br i1 %few, label %enough, label %refuse
enough:
; for each count
%at{i} = getelementptr ptr, ptr %arguments, i64 {i}
%array{i} = load ptr, ptr %at{i}
%$name{i} = call ptr @data(ptr %array{i}, i64 $length{i}, i32 $flags{i})
%wrong{i} = icmp eq ptr %$name{i}, null
br i1 %wrong{i}, label %refuse, label %found{i}
found{i}:
; end
call void inttoptr (i64 $Py_IncRef to ptr)(ptr inttoptr (i64 $none to ptr))
$lines
ret ptr inttoptr (i64 $none to ptr)
refuse:
call void inttoptr (i64 $PyErr_SetString to ptr)(ptr inttoptr (i64 $type_error to ptr), ptr inttoptr (i64 $message to ptr))
ret ptr null
}
