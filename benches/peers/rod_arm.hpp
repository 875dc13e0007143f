// The rod arm in Pinocchio, and a Runge-Kutta step of it, for Pinocchio has none: four calls of `aba` and the sums between them.
//
// Invariant: no allocation in a step, and `aba` gets what it is fastest with here (vectors of its own scalar, one `Data`).
#ifndef ROD_ARM_HPP
#define ROD_ARM_HPP

#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/multibody.hpp>

namespace pin = pinocchio;
using Vector = Eigen::VectorXd;
// The one vector type that `aba` is compiled for in the library.
using Given = Eigen::Ref<const Vector>;

inline pin::Model rod_arm(int links, double gravity)
{
    pin::Model model;
    model.gravity.linear() = Eigen::Vector3d(0.0, -gravity, 0.0);
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

struct RodArm {
    pin::Model model;
    pin::Data data;
    int links;
    pin::Convention convention;
    Vector effort, q, v;

    RodArm(int links, double gravity, pin::Convention convention)
        : model(rod_arm(links, gravity)), data(model), links(links), convention(convention)
    {
        for (Vector *vector : {&effort, &q, &v, &a1, &a2, &a3, &a4, &v2, &v3, &v4, &qs})
            *vector = Vector::Zero(links);
    }

    const Vector &acceleration(const Given &position, const Given &velocity, const Given &effort)
    {
        return pin::aba(model, data, position, velocity, effort, convention);
    }

    const Vector &acceleration(const Given &position, const Given &velocity)
    {
        return acceleration(position, velocity, effort);
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

  private:
    Vector a1, a2, a3, a4, v2, v3, v4, qs;
};

#endif
