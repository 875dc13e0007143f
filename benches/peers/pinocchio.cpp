// The rod arm in Pinocchio: results to be compared, or times.
//
// pinocchio NAME LINKS STATES check|time
//
// Built twice: against the library in the wheel (its own instantiations, by its own compiler and flags), and from the headers alone
// with the flags of this machine. A Runge-Kutta step is written here, for Pinocchio has none: four calls of `aba` and the
// sums between them, on vectors that are allocated once.
//
// Invariant: no allocation in what is timed, and `aba` gets what it is fastest with here (vectors of its own scalar, one `Data`).

#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/multibody.hpp>

#include "harness.h"

namespace pin = pinocchio;
using Vector = Eigen::VectorXd;
// The one vector type that `aba` is compiled for in the library.
using Given = Eigen::Ref<const Vector>;

namespace {

pin::Model rod_arm(int links)
{
    pin::Model model;
    model.gravity.linear() = Eigen::Vector3d(0.0, -GRAVITY, 0.0);
    pin::JointIndex parent = 0;
    for (int i = 0; i < links; i++) {
        const Eigen::Vector3d offset(i == 0 ? 0.0 : 1.0, 0.0, 0.0);
        parent = model.addJoint(parent, pin::JointModelRZ(), pin::SE3(Eigen::Matrix3d::Identity(), offset),
                                "joint" + std::to_string(i + 1));
        // A thin rod of 1 kg and 1 m: no inertia about itself, m l^2 / 12 across.
        const Eigen::Matrix3d inertia = Eigen::Vector3d(0.0, 1.0 / 12.0, 1.0 / 12.0).asDiagonal();
        model.appendBodyToJoint(parent, pin::Inertia(1.0, Eigen::Vector3d(0.5, 0.0, 0.0), inertia), pin::SE3::Identity());
    }
    return model;
}

struct Arm {
    pin::Model model;
    pin::Data data;
    int links;
    pin::Convention convention = pin::Convention::LOCAL;
    Vector effort, q, v, a1, a2, a3, a4, v2, v3, v4, qs;
    std::vector<Vector> positions, velocities, efforts, results;

    Arm(int links, const State *states) : model(rod_arm(links)), data(model), links(links)
    {
        for (Vector *vector : {&effort, &q, &v, &a1, &a2, &a3, &a4, &v2, &v3, &v4, &qs})
            *vector = Vector::Zero(links);
        for (int k = 0; k < CALLS; k++) {
            positions.push_back(Eigen::Map<const Vector>(states[k].q, links));
            velocities.push_back(Eigen::Map<const Vector>(states[k].v, links));
            efforts.push_back(Eigen::Map<const Vector>(states[k].tau, links));
            results.push_back(Vector::Zero(links));
        }
    }

    const Vector &acceleration(const Given &position, const Given &velocity, const Given &effort)
    {
        return pin::aba(model, data, position, velocity, effort, convention);
    }

    const Vector &acceleration(const Given &position, const Given &velocity)
    {
        return acceleration(position, velocity, effort);
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

    void euler(double h)
    {
        a1.noalias() = acceleration(q, v);
        q.noalias() += h * v;
        v.noalias() += h * a1;
    }

    void rk4(double h)
    {
        a1.noalias() = acceleration(q, v);
        v2.noalias() = v + 0.5 * h * a1;
        qs.noalias() = q + 0.5 * h * v;
        a2.noalias() = acceleration(qs, v2);
        v3.noalias() = v + 0.5 * h * a2;
        qs.noalias() = q + 0.5 * h * v2;
        a3.noalias() = acceleration(qs, v3);
        v4.noalias() = v + h * a3;
        qs.noalias() = q + h * v3;
        a4.noalias() = acceleration(qs, v4);
        q.noalias() += h / 6.0 * (v + 2.0 * (v2 + v3) + v4);
        v.noalias() += h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4);
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
