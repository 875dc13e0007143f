// The rod arm's forward dynamics as C, by Pinocchio and CppADCodeGen: `aba` is recorded once, optimised, and written out.
//
// generate LINKS >FILE
//
// The file has `static void forward_dynamics(const double *x, double *y)`, x being positions, velocities and efforts, y
// accelerations. Pinocchio's own code generator (pinocchio/codegen/) records the same way; it would put the C behind a
// library of its own, whose calls would be measured with it.
//
// Invariant: nothing is known of the model but what Pinocchio's own program here is given.

#include <cppad/cg.hpp>
#include <cppad/cg/support/cppadcg_eigen.hpp>

#include <pinocchio/codegen/cppadcg.hpp>

#include <iostream>

#include "harness.h"
#include "rod_arm.hpp"

int main(int count, char **arguments)
{
    if (count != 2)
        fail("usage: generate LINKS");
    using Recorded = CppAD::cg::CG<double>;
    using Scalar = CppAD::AD<Recorded>;
    using Vector = Eigen::Matrix<Scalar, Eigen::Dynamic, 1>;
    const int links = atoi(arguments[1]);
    const pin::ModelTpl<Scalar> model = rod_arm(links, GRAVITY).cast<Scalar>();
    pin::DataTpl<Scalar> data(model);

    Vector x = Vector::Zero(3 * links);
    CppAD::Independent(x);
    const Vector q = x.head(links), v = x.segment(links, links), tau = x.tail(links);
    Vector y = pin::aba(model, data, q, v, tau);
    CppAD::ADFun<Recorded> function(x, y);
    function.optimize("no_compare_op");

    CppAD::cg::CodeHandler<double> handler;
    CppAD::vector<Recorded> inputs(static_cast<size_t>(3 * links));
    handler.makeVariables(inputs);
    CppAD::vector<Recorded> outputs = function.Forward(0, inputs);
    CppAD::cg::LanguageC<double> language("double");
    language.setParameterPrecision(17);
    CppAD::cg::LangCDefaultVariableNameGenerator<double> names("y", "x", "v");
    std::ostringstream code;
    handler.generateCode(code, language, outputs, names);
    std::cout << "static inline void forward_dynamics(const double *x, double *y)\n{\n    double v["
              << handler.getTemporaryVariableCount() + 1 << "];\n"
              << code.str() << "}\n";
    return 0;
}
