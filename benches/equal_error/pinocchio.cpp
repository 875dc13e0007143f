// The rod arm in Pinocchio: what an error costs with `aba` and a Runge-Kutta step written here, for Pinocchio has none.
//
// pinocchio LINKS Q1 [Q2 ...]

#include "../peers/rod_arm.hpp"
#include "sweep.h"

namespace {

void run(void *context, long steps, double *end)
{
    RodArm &arm = *static_cast<RodArm *>(context);
    arm.q.setConstant(START_POSITION);
    arm.v.setConstant(START_VELOCITY);
    for (long step = 0; step < steps; step++)
        arm.rk4(DURATION / static_cast<double>(steps));
    memcpy(end, arm.q.data(), static_cast<size_t>(arm.links) * sizeof(double));
}

} // namespace

int main(int count, char **arguments)
{
    if (count < 4)
        return 2;
    RodArm arm(atoi(arguments[1]), GRAVITY, pin::Convention::WORLD);
    sweep("Pinocchio with its own RK4", arm.links, arguments + 2, run, &arm);
    return 0;
}
