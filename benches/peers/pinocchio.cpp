// The rod arm in Pinocchio: results to be compared, or times.
//
// pinocchio NAME LINKS STATES check|time
//
// Built twice: against the library in the wheel (its own instantiations, by its own compiler and flags), and from the headers alone
// with the flags of this machine.
//
// Invariant: no allocation in what is timed.

#include "harness.h"
#include "rod_arm.hpp"

namespace {

struct Arm : RodArm {
    std::vector<Vector> positions, velocities, efforts, results;

    Arm(int links, const State *states) : RodArm(links, GRAVITY, pin::Convention::LOCAL)
    {
        for (int k = 0; k < CALLS; k++) {
            positions.push_back(Eigen::Map<const Vector>(states[k].q, links));
            velocities.push_back(Eigen::Map<const Vector>(states[k].v, links));
            efforts.push_back(Eigen::Map<const Vector>(states[k].tau, links));
            results.push_back(Vector::Zero(links));
        }
    }

    void start()
    {
        q.setConstant(START_POSITION);
        v.setConstant(START_VELOCITY);
        effort.setZero();
    }

    void start(int k)
    {
        q = positions[k];
        v = velocities[k];
        effort = efforts[k];
    }
};

void independent(void *context)
{
    Arm &arm = *static_cast<Arm *>(context);
    for (int k = 0; k < CALLS; k++)
        arm.results[k].noalias() = arm.acceleration(arm.positions[k], arm.velocities[k], arm.efforts[k]);
}

void chained(void *context)
{
    Arm &arm = *static_cast<Arm *>(context);
    arm.start();
    for (int k = 0; k < CALLS; k++)
        arm.q.noalias() += 1e-9 * arm.acceleration(arm.q, arm.v);
}

void euler_steps(void *context)
{
    Arm &arm = *static_cast<Arm *>(context);
    arm.start();
    for (int k = 0; k < CALLS; k++)
        arm.euler(TIMESTEP);
}

void rk4_steps(void *context)
{
    Arm &arm = *static_cast<Arm *>(context);
    arm.start();
    for (int k = 0; k < CALLS; k++)
        arm.rk4(TIMESTEP);
}

void check(Arm &arm)
{
    independent(&arm);
    for (int k = 0; k < CALLS; k++) {
        print_result("forward", k, arm.links, arm.results[k].data(), nullptr);
        arm.start(k);
        arm.euler(TIMESTEP);
        print_result("euler", k, arm.links, arm.v.data(), nullptr);
        arm.start(k);
        arm.rk4(TIMESTEP);
        print_result("rk4", k, arm.links, arm.q.data(), arm.v.data());
    }
    arm.start();
    for (int k = 0; k < SWING_STEPS; k++)
        arm.rk4(TIMESTEP);
    print_result("swing", 0, arm.links, arm.q.data(), arm.v.data());
}

} // namespace

int main(int count, char **arguments)
{
    if (count != 5)
        fail("usage: pinocchio NAME LINKS STATES check|time");
    const int links = atoi(arguments[2]);
    static State states[CALLS];
    read_states(arguments[3], links, states);
    Arm arm(links, states);
    if (strcmp(arguments[4], "check") == 0) {
        check(arm);
        return 0;
    }
    measure(arguments[1], links, "forward dynamics, throughput", independent, &arm);
    arm.convention = pin::Convention::WORLD;
    measure(arguments[1], links, "forward dynamics in the world frame, throughput", independent, &arm);
    arm.convention = pin::Convention::LOCAL;
    measure(arguments[1], links, "forward dynamics, chained", chained, &arm);
    measure(arguments[1], links, "euler step", euler_steps, &arm);
    measure(arguments[1], links, "rk4 step", rk4_steps, &arm);
    return 0;
}
