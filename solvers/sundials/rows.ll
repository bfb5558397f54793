; Fills rows first <= i < count, in at most `most` steps since the start; returns the first row not filled. Places in
; the report are those of `ReportAt` in compiled.py. Rows within the last step are still filled when no step is left.
define i64 @function(ptr %memory, ptr %y, ptr %slope, ptr %times, ptr %rows, ptr %report,
                     i64 %first, i64 %count, i64 %width, i64 %most) {
entry:
%steps_at = getelementptr i64, ptr %report, i64 1
%now_at = getelementptr i64, ptr %report, i64 2
br label %again
again:
%i = phi i64 [%first, %entry], [%next, %filled]
%more = icmp slt i64 %i, %count
br i1 %more, label %look, label %end
look:
%time_at = getelementptr double, ptr %times, i64 %i
%time = load double, ptr %time_at
call i32 $GetNumSteps(ptr %memory, ptr %steps_at)
%steps = load i64, ptr %steps_at
%left = sub i64 %most, %steps
%any_left = icmp sgt i64 %left, 0
br i1 %any_left, label %solve, label %spent
spent:
call i32 $GetCurrentTime(ptr %memory, ptr %now_at)
%now = load double, ptr %now_at
%within_step = fcmp ole double %time, %now
br i1 %within_step, label %solve, label %end
solve:
%allowed = select i1 %any_left, i64 %left, i64 1
call i32 $SetMaxNumSteps(ptr %memory, i64 %allowed)
%offset = mul i64 %i, %width
%row = getelementptr double, ptr %rows, i64 %offset
call void $N_VSetArrayPointer(ptr %row, ptr %y)
%code = call i32 $solve(ptr %memory, double %time, $arguments, i32 1)
%good = icmp sge i32 %code, 0
br i1 %good, label %filled, label %end
filled:
%next = add i64 %i, 1
br label %again
end:
%last = phi i32 [0, %again], [$too_much_work, %spent], [%code, %solve]
%reported = sext i32 %last to i64
store i64 %reported, ptr %report
call i32 $GetNumSteps(ptr %memory, ptr %steps_at)
call i32 $GetCurrentTime(ptr %memory, ptr %now_at)
%fields_at = getelementptr i64, ptr %report, i64 3
call i32 $evaluations(ptr %memory, ptr %fields_at)
%differences_at = getelementptr i64, ptr %report, i64 4
call i32 $differences(ptr %memory, ptr %differences_at)
%tests_at = getelementptr i64, ptr %report, i64 5
call i32 $GetNumErrTestFails(ptr %memory, ptr %tests_at)
%solves_at = getelementptr i64, ptr %report, i64 6
call i32 $GetNumStepSolveFails(ptr %memory, ptr %solves_at)
%jacobians_at = getelementptr i64, ptr %report, i64 7
call i32 $GetNumJacEvals(ptr %memory, ptr %jacobians_at)
%setups_at = getelementptr i64, ptr %report, i64 8
call i32 $GetNumLinSolvSetups(ptr %memory, ptr %setups_at)
%step_at = getelementptr i64, ptr %report, i64 9
call i32 $GetCurrentStep(ptr %memory, ptr %step_at)
ret i64 %i
}
