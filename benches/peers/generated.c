/* The rod arm by the C that Pinocchio's dynamics were written out as (generate.cpp): results to be compared, or times.
 *
 * generated NAME LINKS STATES check|time
 *
 * The generated function is part of this file, so that the compiler sees it in every loop; GENERATED names its file and
 * JOINTS is the number of links that it was written for. Methods are written here as in pinocchio.cpp.
 *
 * Invariant: no allocation in what is timed, and the function gets what it is fastest with, all its inputs in a row. */

#include <math.h>

#include "harness.h"
#include GENERATED

typedef struct {
    double x[3 * JOINTS]; /* positions, velocities, efforts */
} Arm;

typedef struct {
    Arm states[CALLS];
    Arm steps[CALLS];
    double accelerations[CALLS][JOINTS];
} Context;

static Arm start(void)
{
    Arm arm;
    for (int i = 0; i < JOINTS; i++) {
        arm.x[i] = START_POSITION;
        arm.x[JOINTS + i] = START_VELOCITY;
        arm.x[2 * JOINTS + i] = 0.0;
    }
    return arm;
}

static inline void euler(Arm *arm, double h)
{
    double a[JOINTS];
    forward_dynamics(arm->x, a);
    for (int i = 0; i < JOINTS; i++) {
        arm->x[i] += h * arm->x[JOINTS + i];
        arm->x[JOINTS + i] += h * a[i];
    }
}

static inline Arm moved(const Arm *arm, double h, const double *velocity, const double *acceleration)
{
    Arm next = *arm;
    for (int i = 0; i < JOINTS; i++) {
        next.x[i] += h * velocity[i];
        next.x[JOINTS + i] += h * acceleration[i];
    }
    return next;
}

static inline void rk4(Arm *arm, double h)
{
    double a1[JOINTS], a2[JOINTS], a3[JOINTS], a4[JOINTS];
    const double *v = arm->x + JOINTS;
    forward_dynamics(arm->x, a1);
    const Arm second = moved(arm, 0.5 * h, v, a1);
    forward_dynamics(second.x, a2);
    const Arm third = moved(arm, 0.5 * h, second.x + JOINTS, a2);
    forward_dynamics(third.x, a3);
    const Arm fourth = moved(arm, h, third.x + JOINTS, a3);
    forward_dynamics(fourth.x, a4);
    for (int i = 0; i < JOINTS; i++) {
        const int at = JOINTS + i;
        arm->x[i] += h / 6.0 * (arm->x[at] + 2.0 * (second.x[at] + third.x[at]) + fourth.x[at]);
        arm->x[at] += h / 6.0 * (a1[i] + 2.0 * (a2[i] + a3[i]) + a4[i]);
    }
}

static void independent(void *context)
{
    Context *all = context;
    for (int k = 0; k < CALLS; k++)
        forward_dynamics(all->states[k].x, all->accelerations[k]);
}

static void independent_euler(void *context)
{
    Context *all = context;
    for (int k = 0; k < CALLS; k++) {
        all->steps[k] = all->states[k];
        euler(&all->steps[k], TIMESTEP);
    }
}

static void independent_rk4(void *context)
{
    Context *all = context;
    for (int k = 0; k < CALLS; k++) {
        all->steps[k] = all->states[k];
        rk4(&all->steps[k], TIMESTEP);
    }
}

static void chained(void *context)
{
    Context *all = context;
    Arm arm = start();
    for (int k = 0; k < CALLS; k++) {
        double a[JOINTS];
        forward_dynamics(arm.x, a);
        for (int i = 0; i < JOINTS; i++)
            arm.x[i] += 1e-9 * a[i];
    }
    all->steps[0] = arm;
}

static void euler_steps(void *context)
{
    Context *all = context;
    Arm arm = start();
    for (int k = 0; k < CALLS; k++)
        euler(&arm, TIMESTEP);
    all->steps[0] = arm;
}

static void rk4_steps(void *context)
{
    Context *all = context;
    Arm arm = start();
    for (int k = 0; k < CALLS; k++)
        rk4(&arm, TIMESTEP);
    all->steps[0] = arm;
}

static void check(Context *all)
{
    independent(all);
    for (int k = 0; k < CALLS; k++) {
        print_result("forward", k, JOINTS, all->accelerations[k], NULL);
        Arm arm = all->states[k];
        euler(&arm, TIMESTEP);
        print_result("euler", k, JOINTS, arm.x + JOINTS, NULL);
        arm = all->states[k];
        rk4(&arm, TIMESTEP);
        print_result("rk4", k, JOINTS, arm.x, arm.x + JOINTS);
    }
    Arm arm = start();
    for (int k = 0; k < SWING_STEPS; k++)
        rk4(&arm, TIMESTEP);
    print_result("swing", 0, JOINTS, arm.x, arm.x + JOINTS);
}

int main(int count, char **arguments)
{
    static State states[CALLS];
    static Context all;
    if (count != 5 || atoi(arguments[2]) != JOINTS)
        fail("usage: generated NAME LINKS STATES check|time");
    read_states(arguments[3], JOINTS, states);
    for (int k = 0; k < CALLS; k++)
        for (int i = 0; i < JOINTS; i++) {
            all.states[k].x[i] = states[k].q[i];
            all.states[k].x[JOINTS + i] = states[k].v[i];
            all.states[k].x[2 * JOINTS + i] = states[k].tau[i];
        }
    if (strcmp(arguments[4], "check") == 0) {
        check(&all);
        return 0;
    }
    measure(arguments[1], JOINTS, "forward dynamics, throughput", independent, &all);
    measure(arguments[1], JOINTS, "forward dynamics, chained", chained, &all);
    measure(arguments[1], JOINTS, "euler step", euler_steps, &all);
    measure(arguments[1], JOINTS, "euler step, independent", independent_euler, &all);
    measure(arguments[1], JOINTS, "rk4 step", rk4_steps, &all);
    measure(arguments[1], JOINTS, "rk4 step, independent", independent_rk4, &all);
    return 0;
}
