/* The rod arm in MuJoCo: what an error costs with its Runge-Kutta method and with the implicit one that it recommends.
 *
 * mujoco LINKS Q1 [Q2 ...]
 *
 * Everything is off that an arm without contact, limits, damping or sensors does not need. */
#include "../peers/rod_arm.h"
#include "sweep.h"

typedef struct {
    mjModel *model;
    mjData *data;
    int links;
} Arm;

/* A timestep that is too long says so by its error. */
static void keep_quiet(const char *warning)
{
    (void)warning;
}

static void run(void *context, long steps, double *end)
{
    Arm *arm = context;
    mj_resetData(arm->model, arm->data);
    arm->model->opt.timestep = DURATION / (double)steps;
    for (int i = 0; i < arm->links; i++) {
        arm->data->qpos[i] = START_POSITION;
        arm->data->qvel[i] = START_VELOCITY;
    }
    for (long step = 0; step < steps; step++)
        mj_step(arm->model, arm->data);
    memcpy(end, arm->data->qpos, (size_t)arm->links * sizeof(double));
}

int main(int count, char **arguments)
{
    if (count < 4 || mj_version() != mjVERSION_HEADER)
        return 2;
    mju_user_warning = keep_quiet;
    Arm arm = {.links = atoi(arguments[1])};
    arm.model = rod_arm(arm.links, true);
    arm.data = mj_makeData(arm.model);
    arm.model->opt.integrator = mjINT_RK4;
    sweep("MuJoCo RK4", arm.links, arguments + 2, run, &arm);
    arm.model->opt.integrator = mjINT_IMPLICITFAST;
    sweep("MuJoCo implicitfast", arm.links, arguments + 2, run, &arm);
    mj_deleteData(arm.data);
    mj_deleteModel(arm.model);
    return 0;
}
