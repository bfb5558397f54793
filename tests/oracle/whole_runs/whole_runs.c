/* Rotation of a massive ellipsoid in simple shear flow, in long double, by extrapolation.

   Nothing here is shared with the project. The state is the rotation matrix, nine numbers whose row
   i is body axis i in space components, and the angular momentum in space components. The equations
   are dL/dt = torque and d(axis i)/dt = omega x (axis i); the torque is Jeffery's,
   -8 pi X_i (omega_i - omega_iJ) / St about body axis i.

   Method: Gragg's modified midpoint rule, extrapolated in the square of the step (Hairer, Norsett,
   Wanner, Solving Ordinary Differential Equations I, section II.9), with steps by error control.

   Input, one line: St, a b c, I1 I2 I3, X1 X2 X3, the twelve numbers of the state, tolerance,
   columns of the extrapolation, number of rows, end. Output: a row of time and state per line. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define N 12
#define MOST_COLUMNS 12

typedef long double real;

static real stokes, axes2[3], inertia[3], resistance[3];
static const real PI = 3.14159265358979323846264338327950288L;

static void rates(const real *y, real *f)
{
    const real *momentum = y + 9;
    real spin[3], torque[3], space[3], *dmomentum = f + 9;
    for (int i = 0; i < 3; i++) {
        const real *axis = y + 3 * i;
        spin[i] = (axis[0] * momentum[0] + axis[1] * momentum[1] + axis[2] * momentum[2]) / inertia[i];
    }
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        /* Components x_j y_k and x_k y_j of the velocity gradient in body axes. */
        real gradient_kj = y[3 * k] * y[3 * j + 1];
        real gradient_jk = y[3 * j] * y[3 * k + 1];
        real jeffery = (axes2[j] * gradient_kj - axes2[k] * gradient_jk) / (axes2[j] + axes2[k]);
        torque[i] = -8 * PI * resistance[i] * (spin[i] - jeffery) / stokes;
    }
    for (int c = 0; c < 3; c++) {
        space[c] = spin[0] * y[c] + spin[1] * y[3 + c] + spin[2] * y[6 + c];
        dmomentum[c] = torque[0] * y[c] + torque[1] * y[3 + c] + torque[2] * y[6 + c];
    }
    for (int i = 0; i < 3; i++) {
        const real *axis = y + 3 * i;
        f[3 * i] = space[1] * axis[2] - space[2] * axis[1];
        f[3 * i + 1] = space[2] * axis[0] - space[0] * axis[2];
        f[3 * i + 2] = space[0] * axis[1] - space[1] * axis[0];
    }
}

/* One step of the modified midpoint rule with n substeps. */
static void midpoint(const real *start, const real *first, real step, int n, real *end)
{
    real h = step / n, before[N], here[N], next[N], f[N];
    for (int i = 0; i < N; i++) {
        before[i] = start[i];
        here[i] = start[i] + h * first[i];
    }
    for (int m = 1; m < n; m++) {
        rates(here, f);
        for (int i = 0; i < N; i++) {
            next[i] = before[i] + 2 * h * f[i];
            before[i] = here[i];
            here[i] = next[i];
        }
    }
    rates(here, f);
    for (int i = 0; i < N; i++)
        end[i] = (here[i] + before[i] + h * f[i]) / 2;
}

/* Error of a step over the tolerance; the state after it in `end`. */
static real extrapolated(const real *start, real step, int columns, real tolerance, real *end)
{
    static real table[MOST_COLUMNS][N];
    real first[N], error = 0;
    rates(start, first);
    for (int j = 0; j < columns; j++) {
        int n = 2 * (j + 1);
        real above[N], here[N];
        midpoint(start, first, step, n, here);
        for (int k = 1; k <= j; k++) {
            real ratio = (real)n / (2 * (j - k + 1));
            for (int i = 0; i < N; i++) {
                above[i] = table[k - 1][i];
                table[k - 1][i] = here[i];
                here[i] += (here[i] - above[i]) / (ratio * ratio - 1);
            }
        }
        if (j == columns - 1)
            for (int i = 0; i < N; i++) {
                /* At rest L is zero; the flow alone makes it of the order of the inertia. */
                real size = fabsl(start[9]) + fabsl(start[10]) + fabsl(start[11]);
                real scale = i < 9 ? 1 : size > inertia[0] ? size : inertia[0];
                real off = fabsl(here[i] - table[columns - 2][i]) / scale;
                /* Written so that a NaN is an error. */
                error = off <= error ? error : off;
                end[i] = here[i];
            }
        else
            for (int i = 0; i < N; i++)
                table[j][i] = here[i];
    }
    return error / tolerance;
}

int main(void)
{
    real axes[3], y[N], trial[N], tolerance, end, time = 0, step;
    int columns, rows;
    if (scanf("%Lf", &stokes) != 1) return 2;
    for (int i = 0; i < 3; i++) { if (scanf("%Lf", axes + i) != 1) return 2; axes2[i] = axes[i] * axes[i]; }
    for (int i = 0; i < 3; i++) if (scanf("%Lf", inertia + i) != 1) return 2;
    for (int i = 0; i < 3; i++) if (scanf("%Lf", resistance + i) != 1) return 2;
    for (int i = 0; i < N; i++) if (scanf("%Lf", y + i) != 1) return 2;
    if (scanf("%Lf %d %d %Lf", &tolerance, &columns, &rows, &end) != 4) return 2;
    if (columns > MOST_COLUMNS) return 2;
    step = end / (rows - 1);
    if (step > 0.1L) step = 0.1L;
    for (int row = 0; row < rows; row++) {
        real goal = end * row / (rows - 1);
        while (time < goal) {
            real rest = goal - time, h = step < rest ? step : rest;
            real error = extrapolated(y, h, columns, tolerance, trial);
            real factor = 0.9L * powl(error + 1e-9L, -1.0L / (2 * columns - 1));
            if (error <= 1) {
                for (int i = 0; i < N; i++) y[i] = trial[i];
                time = h == rest ? goal : time + h;
            }
            if (!(error <= 1) || h == step)
                step = h * (factor > 3 ? 3 : factor > 0.2L ? factor : 0.2L);
        }
        printf("%.20Lg", time);
        for (int i = 0; i < N; i++) printf(" %.20Lg", y[i]);
        printf("\n");
    }
    return 0;
}
