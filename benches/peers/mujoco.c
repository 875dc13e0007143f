/* The rod arm in MuJoCo: results to be compared, or times.
 *
 * mujoco NAME LINKS STATES check|time [bare]
 *
 * As it comes, with contact off; with `bare`, everything off that an arm without contact, limits, damping or sensors does not need.
 * The model has no geometry: bodies with inertia, hinges about z. MuJoCo's Euler step is semi-implicit (the new velocity
 * moves the position), so that only its velocity is compared with the explicit one.
 *
 * Invariant: no allocation in what is timed; a chain is started by writing position and velocity, not by a reset. */

#include "rod_arm.h"

typedef struct {
    mjModel *model;
    mjData *data;
    int links;
    const State *states;
    double results[CALLS][LINKS_MAX];
} Arm;

static void start(Arm *arm, const State *state)
{
    for (int i = 0; i < arm->links; i++) {
        arm->data->qpos[i] = state ? state->q[i] : START_POSITION;
        arm->data->qvel[i] = state ? state->v[i] : START_VELOCITY;
        arm->data->qfrc_applied[i] = state ? state->tau[i] : 0.0;
    }
}

static void independent(void *context)
{
    Arm *arm = context;
    for (int k = 0; k < CALLS; k++) {
        start(arm, &arm->states[k]);
        mj_forward(arm->model, arm->data);
        memcpy(arm->results[k], arm->data->qacc, (size_t)arm->links * sizeof(double));
    }
}

static void chained(void *context)
{
    Arm *arm = context;
    start(arm, NULL);
    for (int k = 0; k < CALLS; k++) {
        mj_forward(arm->model, arm->data);
        for (int i = 0; i < arm->links; i++)
            arm->data->qpos[i] += 1e-9 * arm->data->qacc[i];
    }
}

static void steps(void *context)
{
    Arm *arm = context;
    start(arm, NULL);
    for (int k = 0; k < CALLS; k++)
        mj_step(arm->model, arm->data);
}

static void check(Arm *arm)
{
    independent(arm);
    for (int k = 0; k < CALLS; k++) {
        print_result("forward", k, arm->links, arm->results[k], NULL);
        arm->model->opt.integrator = mjINT_EULER;
        start(arm, &arm->states[k]);
        mj_step(arm->model, arm->data);
        print_result("euler", k, arm->links, arm->data->qvel, NULL);
        arm->model->opt.integrator = mjINT_RK4;
        start(arm, &arm->states[k]);
        mj_step(arm->model, arm->data);
        print_result("rk4", k, arm->links, arm->data->qpos, arm->data->qvel);
    }
    start(arm, NULL);
    for (int k = 0; k < SWING_STEPS; k++)
        mj_step(arm->model, arm->data);
    print_result("swing", 0, arm->links, arm->data->qpos, arm->data->qvel);
}

int main(int count, char **arguments)
{
    static State states[CALLS];
    static Arm arm;
    if (count < 5)
        fail("usage: mujoco NAME LINKS STATES check|time [bare]");
    if (mj_version() != mjVERSION_HEADER)
        fail("the header and the library of MuJoCo are not of one version");
    arm.links = atoi(arguments[2]);
    read_states(arguments[3], arm.links, states);
    arm.states = states;
    arm.model = rod_arm(arm.links, count > 5);
    arm.data = mj_makeData(arm.model);
    if (strcmp(arguments[4], "check") == 0) {
        check(&arm);
    } else {
        measure(arguments[1], arm.links, "forward dynamics, throughput", independent, &arm);
        measure(arguments[1], arm.links, "forward dynamics, chained", chained, &arm);
        arm.model->opt.integrator = mjINT_EULER;
        measure(arguments[1], arm.links, "euler step", steps, &arm);
        arm.model->opt.integrator = mjINT_RK4;
        measure(arguments[1], arm.links, "rk4 step", steps, &arm);
    }
    mj_deleteData(arm.data);
    mj_deleteModel(arm.model);
    return 0;
}
