// SPDX-License-Identifier: BSD-2-Clause
// What does computeDynamics cost beside the call of Pinocchio that it cannot do without? And what
// does a controller's whole tick cost, to be compared with the same in Python?
#include <pinocchio/algorithm/centroidal.hpp>

#include "cases.hpp"
#include "robots.hpp"

namespace dynacom::benchmarks {
namespace {

struct Motion {
  Eigen::VectorXd q, v, a;
};

// A motion without symmetries, the same every time.
Motion makeMotion(const pinocchio::Model& model) {
  Motion motion = {pinocchio::neutral(model), Eigen::VectorXd::LinSpaced(model.nv, -0.5, 0.5),
                   Eigen::VectorXd::LinSpaced(model.nv, 1., -1.)};
  motion.q.tail(model.nq - 7).setLinSpaced(-0.2, 0.3);
  return motion;
}

std::function<void()> prepareReference() {
  const pinocchio::Model model = makeTalos().getModel();
  return [model, data = pinocchio::Data(model), motion = makeMotion(model)]() mutable {
    pinocchio::computeCentroidalMomentumTimeVariation(model, data, motion.q, motion.v, motion.a);
  };
}

std::function<void()> prepareDynamics() {
  DynaCoM talos = makeTalos();
  return [talos, motion = makeMotion(talos.getModel())]() mutable {
    talos.computeDynamics(motion.q, motion.v, motion.a);
  };
}

std::function<void()> prepareDynamicsOfData() {
  DynaCoM talos = makeTalos();
  pinocchio::Data data(talos.getModel());
  const Motion motion = makeMotion(talos.getModel());
  pinocchio::computeCentroidalMomentumTimeVariation(talos.getModel(), data, motion.q, motion.v,
                                                    motion.a);
  return [talos, data]() mutable { talos.computeDynamics(data); };
}

// At rest in the neutral configuration, as in python_tick.py.
std::function<void()> prepareTick() {
  DynaCoM talos = makeTalos();
  const Eigen::VectorXd q = pinocchio::neutral(talos.getModel());
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(talos.getModel().nv);
  return [talos, q, rest]() mutable {
    talos.computeDynamics(q, rest, rest);
    talos.distributeForce(talos.getGroundCoMForce(), talos.getGroundCoMTorque(), talos.getCoM());
  };
}

}  // namespace

std::vector<Case> makeCases() {
  const std::string reference = "computeCentroidalMomentumTimeVariation";
  return {{reference, prepareReference},
          {"computeDynamics", prepareDynamics, reference},
          {"computeDynamics(data)", prepareDynamicsOfData, reference},
          {"tick", prepareTick, reference}};
}

}  // namespace dynacom::benchmarks
