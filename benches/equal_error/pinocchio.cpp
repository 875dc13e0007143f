// The rod arm in Pinocchio: what an error costs with `aba` and a Runge-Kutta step written here, for Pinocchio has none.
//
// pinocchio LINKS Q1 [Q2 ...]

#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/multibody.hpp>

#include "sweep.h"

namespace pin = pinocchio;
using Vector = Eigen::VectorXd;
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
        const Eigen::Matrix3d inertia = Eigen::Vector3d(0.0, 1.0 / 12.0, 1.0 / 12.0).asDiagonal();
        model.appendBodyToJoint(parent, pin::Inertia(1.0, Eigen::Vector3d(0.5, 0.0, 0.0), inertia), pin::SE3::Identity());
    }
    return model;
}

struct Arm {
    pin::Model model;
    pin::Data data;
    int links;
    Vector effort, q, v, a1, a2, a3, a4, v2, v3, v4, qs;

    explicit Arm(int links) : model(rod_arm(links)), data(model), links(links)
    {
        for (Vector *vector : {&effort, &q, &v, &a1, &a2, &a3, &a4, &v2, &v3, &v4, &qs})
            *vector = Vector::Zero(links);
    }

    const Vector &acceleration(const Given &position, const Given &velocity, const Given &effort)
    {
        return pin::aba(model, data, position, velocity, effort, pin::Convention::WORLD);
    }

    void rk4(double h)
    {
        a1.noalias() = acceleration(q, v, effort);
        v2.noalias() = v + 0.5 * h * a1;
        qs.noalias() = q + 0.5 * h * v;
        a2.noalias() = acceleration(qs, v2, effort);
        v3.noalias() = v + 0.5 * h * a2;
        qs.noalias() = q + 0.5 * h * v2;
        a3.noalias() = acceleration(qs, v3, effort);
        v4.noalias() = v + h * a3;
        qs.noalias() = q + h * v3;
        a4.noalias() = acceleration(qs, v4, effort);
        q.noalias() += h / 6.0 * (v + 2.0 * (v2 + v3) + v4);
        v.noalias() += h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4);
    }
};

void run(void *context, long steps, double *end)
{
    Arm &arm = *static_cast<Arm *>(context);
    arm.q.setConstant(START_POSITION);
    arm.v.setConstant(START_RATE);
    for (long step = 0; step < steps; step++)
        arm.rk4(DURATION / static_cast<double>(steps));
    memcpy(end, arm.q.data(), static_cast<size_t>(arm.links) * sizeof(double));
}

} // namespace

int main(int count, char **arguments)
{
    if (count < 4)
        return 2;
    Arm arm(atoi(arguments[1]));
    sweep("Pinocchio with its own RK4", arm.links, arguments + 2, run, &arm);
    return 0;
}
