// SPDX-License-Identifier: BSD-2-Clause
// In a control loop nothing allocates.
#define BOOST_TEST_MODULE allocation
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <new>
#include <optional>
#include <utility>

#include "asked_solvers.hpp"
#include "dynacom/contact6d.hpp"
#include "dynacom/contact_point.hpp"
#include "dynacom/dyna_com.hpp"
#include "feet.hpp"
#include "kept_storage.hpp"
#include "malloc_counter.hpp"
#include "random_problems.hpp"
#include "random_robot.hpp"
#include "set_problems.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

// Long enough that a string has to allocate for them.
std::string frameName(int i) { return "the frame of foot number " + std::to_string(i); }
std::string contactName(int i) { return "what foot number " + std::to_string(i) + " stands on"; }
std::string idleName(int i) { return contactName(i) + ", another one"; }

/// A robot on two soles, on four points, or on two of each, with as many contacts again that are
/// known but take no part. Nothing has been computed.
struct Standing {
  enum Feet { kSoles, kPoints, kBoth };

  explicit Standing(Feet feet)
      : random(1), model(makeModel(random, feet == kSoles ? 2 : 4)), dynacom(model) {
    for (int i = 0; i < (feet == kSoles ? 2 : 4); ++i) {
      for (const bool active : {true, false}) {
        std::shared_ptr<ContactBase> contact = makeSole(frameName(i));
        if (feet == kPoints || (feet == kBoth && (i < 2) == active)) {
          ContactPointSettings settings = makePoint(frameName(i))->getSettings();
          settings.world_aligned = i % 2 == 0;
          settings.radius = 0.01;
          contact = std::make_shared<ContactPoint>(settings);
        }
        names.push_back(active ? contactName(i) : idleName(i));
        dynacom.addContact(contact, names.back(), active);
      }
    }
  }
  Standing(const Standing&) = delete;

  static pinocchio::Model makeModel(Random& random, int feet) {
    pinocchio::Model model = standingRobot(random, stance(feet));
    for (int i = 0; i < feet; ++i) {
      pinocchio::Frame frame = model.frames[model.getFrameId("sole" + std::to_string(i))];
      frame.name = frameName(i);
      model.addFrame(frame);
    }
    return model;
  }

  State moving() { return randomState(model, random, 0.02); }

  void compute(const State& x) { dynacom.computeNL(3., x.q, x.v, x.a, Vector6::Zero(), false); }

  std::vector<std::shared_ptr<ContactBase>> activeContacts() const {
    std::vector<std::shared_ptr<ContactBase>> contacts;
    for (const auto& name : dynacom.getActiveContacts())
      contacts.push_back(dynacom.getContact(name));
    return contacts;
  }

  DistributionStatus distribute() {
    return dynacom.distributeForce(dynacom.getGroundCoMForce(), dynacom.getGroundCoMTorque(),
                                   dynacom.getCoM());
  }

  Random random;
  pinocchio::Model model;
  DynaCoM dynacom;
  std::vector<std::string> names;
};

constexpr std::array<Standing::Feet, 3> kAllFeet = {Standing::kSoles, Standing::kPoints,
                                                    Standing::kBoth};

/// How often each status has come out.
class Tally {
 public:
  int& operator[](DistributionStatus status) { return counts_[static_cast<std::size_t>(status)]; }

 private:
  std::array<int, 5> counts_{};
};

/// Activates and deactivates at random, moves, and distributes wrenches in reach and out of it.
/// Nothing of that allocates, from the first time on.
void checkThatActivationAllocatesNothing(DynaCoM& dynacom, const std::vector<std::string>& names,
                                         Random& random) {
  Tally tally;
  for (int trial = 0; trial < 150; ++trial) {
    const State x = randomState(dynacom.getModel(), random, 0.02);
    const std::string& name = names[random.integer(0, Index(names.size()) - 1)];
    const bool activate = random.integer(0, 2) > 0;
    const Vector6 external = random.vector(6, random.coin() ? 1. : 200.);
    const bool flat = random.coin();
    auto status = DistributionStatus::NoContact;
    BOOST_TEST(allocationsIn([&] {
                 if (activate)
                   dynacom.activateContact(name);
                 else
                   dynacom.deactivateContact(name);
                 dynacom.computeNL(3., x.q, x.v, x.a, external, flat);
                 status = dynacom.distributeForce(dynacom.getGroundCoMForce(),
                                                  dynacom.getGroundCoMTorque(), dynacom.getCoM());
               }) == 0);
    ++tally[status];
  }
  BOOST_TEST(tally[DistributionStatus::Solved] > 20);
  BOOST_TEST(tally[DistributionStatus::Relaxed] > 20);
}

}  // namespace

BOOST_AUTO_TEST_CASE(the_counter_sees_into_libraries) {
  Standing standing(Standing::kSoles);
  DynaCoM& dynacom = standing.dynacom;
  // Functions of the shared library, of which each has to allocate: a std::vector of std::string,
  // an Eigen matrix, a contact.
  BOOST_TEST(allocationsIn([&] { dynacom.getActiveContacts(); }) > 0);
  BOOST_TEST(allocationsIn([&] { dynacom.uni_A(); }) > 0);
  BOOST_TEST(allocationsIn([&] { dynacom.getContact(standing.names[0])->clone(); }) > 0);
  // And of Pinocchio's.
  BOOST_TEST(allocationsIn([&] { pinocchio::Data data(dynacom.getModel()); }) > 10);
  // In the executable, each way in, and out.
  void* volatile pointer = nullptr;
  BOOST_TEST(allocationsIn([&] { pointer = std::malloc(8); }) == 1);
  BOOST_TEST(allocationsIn([&] { pointer = std::realloc(pointer, 8000); }) == 1);
  BOOST_TEST(allocationsIn([&] { std::free(pointer); }) == 1);
  BOOST_TEST(allocationsIn([&] { std::free(nullptr); }) == 0);
  BOOST_TEST(allocationsIn([&] { pointer = std::calloc(2, 8); }) == 1);
  std::free(pointer);
  BOOST_TEST(allocationsIn([&] { pointer = std::aligned_alloc(64, 64); }) == 1);
  std::free(pointer);
  BOOST_TEST(allocationsIn([&] { pointer = operator new(8); }) == 1);
  operator delete(pointer);
  BOOST_TEST(allocationsIn([&] { pointer = operator new(64, std::align_val_t(64)); }) == 1);
  operator delete(pointer, std::align_val_t(64));
  // And only while it is asked to.
  const int before = allocations;
  dynacom.getActiveContacts();
  BOOST_TEST(allocations == before);
}

BOOST_AUTO_TEST_CASE(control_loop_allocates_nothing) {
  for (const auto feet : kAllFeet) {
    Standing standing(feet);
    DynaCoM& dynacom = standing.dynacom;
    int solved = 0;
    for (int trial = 0; trial < 20; ++trial) {
      const State x = standing.moving();
      const Vector6 external = standing.random.vector(6, 2.);
      BOOST_TEST(allocationsIn([&] { dynacom.computeDynamics(x.q, x.v, x.a); }) == 0);
      BOOST_TEST(allocationsIn([&] { dynacom.computeDynamics(x.q, x.v, x.a, external); }) == 0);
      BOOST_TEST(allocationsIn([&] { dynacom.computeNL(3.); }) == 0);
      auto status = DistributionStatus::NoContact;
      BOOST_TEST(allocationsIn([&] { status = standing.distribute(); }) == 0);
      BOOST_TEST(allocationsIn([&] { dynacom.computeDynamics(x.q, x.v, x.a, external, false); }) ==
                 0);
      BOOST_TEST(allocationsIn([&] { dynacom.computeNL(3., x.q, x.v, x.a, external, false); }) ==
                 0);
      GroundPlane slope{standing.random.vector3(), Vector3d(0.1, 0.2, 3.)};
      BOOST_TEST(allocationsIn([&] { dynacom.computeNL(3., x.q, x.v, x.a, external, slope); }) ==
                 0);
      BOOST_TEST(dynacom.isCoPDefined());
      if (status == DistributionStatus::Solved) ++solved;
    }
    BOOST_TEST(solved > 10);
  }
}

BOOST_AUTO_TEST_CASE(weights_of_cones_change_without_allocating) {
  ContactPointSettings of_point;
  Contact6DSettings of_sole;
  of_point.frame_name = of_sole.frame_name = "sole";
  of_point.friction = of_sole.friction = FrictionModel::Cone;
  ContactPoint point(of_point);
  Contact6D sole(of_sole);
  const Vector3d weights(1., 2., 3.), others(4., 5., 6.);
  const auto revision = sole.getRevision();
  BOOST_TEST(allocationsIn([&] {
               point.setForceWeights(weights);
               sole.setForceWeights(weights);
               sole.setTorqueWeights(others);
             }) == 0);
  BOOST_TEST(point.reg_A() == weights);
  Vector6 both;
  both << weights, others;
  BOOST_TEST(sole.reg_A() == both);
  BOOST_TEST((point.getSet() && sole.getSet()));
  BOOST_TEST(sole.getRevision() != revision);  // or nobody would look at it again
}

BOOST_AUTO_TEST_CASE(what_goes_wrong_in_the_world_allocates_nothing) {
  for (const auto feet : kAllFeet) {
    Standing standing(feet);
    DynaCoM& dynacom = standing.dynacom;
    standing.compute(restState(standing.model));
    BOOST_REQUIRE(dynacom.getDistributionStatus() == DistributionStatus::Solved);
    const Vector3d com = dynacom.getCoM();
    auto status = DistributionStatus::Solved;
    const auto distribute = [&](const Vector3d& force) {
      return allocationsIn([&] { status = dynacom.distributeForce(force, Vector3d::Zero(), com); });
    };
    // In the first control tick that meets it, too.
    BOOST_TEST(distribute({0., 0., -500.}) == 0);
    BOOST_TEST(status == DistributionStatus::Relaxed);
    BOOST_TEST(distribute({0., 0., 0. / 0.}) == 0);
    BOOST_TEST(status == DistributionStatus::InvalidInput);
    BOOST_TEST(distribute({1e308, 1e308, 1.7e308}) == 0);
    BOOST_TEST(status == DistributionStatus::NumericalFailure);
    BOOST_TEST(distribute({0., 0., 0.}) == 0);
    BOOST_TEST(status == DistributionStatus::Solved);

    // A sensor that fails.
    State x = restState(standing.model);
    x.v[0] = 0. / 0.;
    for (const bool flat : {true, false}) {
      BOOST_TEST(
          allocationsIn([&] { dynacom.computeNL(3., x.q, x.v, x.a, Vector6::Zero(), flat); }) == 0);
      BOOST_TEST(!dynacom.isCoPDefined());
    }

    // No contact at all.
    for (const auto& name : dynacom.getActiveContacts()) dynacom.deactivateContact(name);
    BOOST_TEST(distribute({0., 0., 500.}) == 0);
    BOOST_TEST(status == DistributionStatus::NoContact);
  }
}

BOOST_AUTO_TEST_CASE(motions_out_of_reach_allocate_nothing) {
  for (const auto feet : kAllFeet) {
    Standing standing(feet);
    DynaCoM& dynacom = standing.dynacom;
    int relaxed = 0;
    for (int trial = 0; trial < 20; ++trial) {
      const State x = standing.moving();
      const Vector6 external = standing.random.vector(6, 300.);
      BOOST_TEST(allocationsIn([&] { dynacom.computeNL(3., x.q, x.v, x.a, external, false); }) ==
                 0);
      if (dynacom.getDistributionStatus() == DistributionStatus::Relaxed) ++relaxed;
      BOOST_TEST(allocationsIn([&] { standing.distribute(); }) == 0);
    }
    BOOST_TEST(relaxed > 10);
  }
}

BOOST_AUTO_TEST_CASE(getters_that_return_references_allocate_nothing) {
  Standing standing(Standing::kSoles);
  DynaCoM& dynacom = standing.dynacom;
  standing.compute(restState(standing.model));
  const std::string& name = standing.names[0];
  double sum = 0.;
  BOOST_TEST(allocationsIn([&] {
               sum += dynacom.getMass() + dynacom.getGroundHeight() + dynacom.getCoM().x() +
                      dynacom.getVCoM().x() + dynacom.getACoM().x() + dynacom.getAM().x() +
                      dynacom.getAMVariation().x() + dynacom.getGroundCoMForce().x() +
                      dynacom.getGroundCoMTorque().x() + dynacom.getCoP().x() +
                      dynacom.getVRP().x() + dynacom.getNL().x() + dynacom.getFeasibleACoM().x() +
                      dynacom.getCoP3D().x() + dynacom.getVRP3D().x() + dynacom.getECMP().x() +
                      dynacom.getFeasibleAMVariation().x() + dynacom.getMinimalVerticalForce() +
                      dynacom.getWrenchWeights()[0] + dynacom.getWarmStart() +
                      dynacom.getMaximalIterations() + dynacom.getDistribution().iterations +
                      dynacom.getDistribution().isOptimal() + dynacom.ne_b()[1] +
                      dynacom.isCoPDefined() + dynacom.getDistribution().residual[0] +
                      dynacom.getDistribution().contacts[0].force[0] +
                      dynacom.getSettings().gravity.z() + dynacom.getModel().nq +
                      dynacom.getData().com[0].x();
               const ContactBase& contact = *dynacom.getContact(name);
               sum += contact.appliedForce()[2] + contact.ne_A()(0, 0) + contact.uni_A()(0, 0) +
                      contact.uni_b()[0] + contact.fri_A()(0, 0) + contact.fri_b()[0] +
                      contact.reg_A()[0] + contact.reg_b()[0] + contact.getPose().translation().x();
               // These are small enough to be returned on the stack.
               sum += contact.toWorldForces().x() + contact.toCoMForces().x() +
                      contact.getCoP().x() + contact.getSurfacePose().translation().x() +
                      dynacom.getContactCoP(name).x() + dynacom.getContactFrictionUsage(name) +
                      dynacom.getContactCoPMargin(name) + dynacom.getContactYawUsage(name) +
                      dynacom.getCMP(GroundPlane()).x() + dynacom.getZMP(GroundPlane()).x();
             }) == 0);
  BOOST_TEST(std::isfinite(sum));
}

BOOST_AUTO_TEST_CASE(what_dynacom_does_to_contacts_allocates_nothing) {
  // A controller that has contacts of its own does it, too.
  Standing standing(Standing::kSoles);
  auto& sole = dynamic_cast<Contact6D&>(*standing.dynacom.getContact(standing.names[0]));
  const Vector6 force = Vector6::Ones();
  BOOST_TEST(allocationsIn([&] {
               sole.applyForce(force);
               sole.deactivate();
               sole.updateNewtonEuler(Vector3d::Zero(), SE3::Identity());
             }) == 0);
}

BOOST_AUTO_TEST_CASE(activating_and_deactivating_allocate_nothing) {
  for (const auto feet : kAllFeet) {
    Standing standing(feet);
    checkThatActivationAllocatesNothing(standing.dynacom, standing.names, standing.random);
  }
}

BOOST_AUTO_TEST_CASE(a_contact_that_was_never_used_allocates_nothing_when_it_is) {
  for (const auto feet : kAllFeet) {
    Standing standing(feet);
    DynaCoM& dynacom = standing.dynacom;
    standing.compute(restState(standing.model));
    BOOST_TEST(allocationsIn([&] {
                 for (const std::string& name : standing.names) dynacom.deactivateContact(name);
               }) == 0);
    for (const std::string& name : standing.names) {
      BOOST_TEST(allocationsIn([&] { dynacom.activateContact(name); }) == 0);
      BOOST_TEST(allocationsIn([&] { standing.distribute(); }) == 0);
      BOOST_TEST(dynacom.getDistribution().isOptimal());
    }
    BOOST_TEST(dynacom.getDistribution().contacts.size() == standing.names.size());
  }
}

BOOST_AUTO_TEST_CASE(a_copy_allocates_nothing_either) {
  for (const auto feet : kAllFeet) {
    Standing standing(feet);
    // Before anything was computed, and while not all contacts take part.
    for (const bool moved : {false, true}) {
      if (moved) {
        standing.dynacom.deactivateContact(standing.names[0]);
        standing.compute(restState(standing.model));
      }
      DynaCoM copy = standing.dynacom;
      checkThatActivationAllocatesNothing(copy, standing.names, standing.random);
      DynaCoM assigned;
      assigned = copy;
      checkThatActivationAllocatesNothing(assigned, standing.names, standing.random);
      const DynaCoM taken = std::move(assigned);
      DynaCoM again = taken;
      checkThatActivationAllocatesNothing(again, standing.names, standing.random);
    }
    checkThatActivationAllocatesNothing(standing.dynacom, standing.names, standing.random);
  }
}

BOOST_AUTO_TEST_CASE(contacts_in_the_place_of_others_allocate_when_they_are_added_only) {
  // A contact takes the slot of one that has been removed, and may be larger or smaller.
  for (const bool active : {true, false}) {
    Standing standing(Standing::kPoints);
    DynaCoM& dynacom = standing.dynacom;
    standing.compute(restState(standing.model));
    dynacom.removeContact(standing.names[0]);
    dynacom.addContact(makeSole(frameName(0)), "sole", active);
    const std::string name = "sole";
    BOOST_TEST(allocationsIn([&] { standing.distribute(); }) == 0);
    BOOST_TEST(allocationsIn([&] { dynacom.activateContact(name); }) == 0);
    BOOST_TEST(allocationsIn([&] { standing.distribute(); }) == 0);
    BOOST_TEST(dynacom.getDistribution().isOptimal());
  }
  for (const bool last_is_point : {false, true}) {
    Standing standing(Standing::kBoth);
    DynaCoM& dynacom = standing.dynacom;
    std::vector<std::string>& names = standing.names;
    standing.compute(restState(standing.model));
    for (int trial = 0; trial < 8; ++trial) {
      const auto removed = names.begin() + standing.random.integer(0, Index(names.size()) - 1);
      dynacom.removeContact(*removed);
      names.erase(removed);
      if (standing.random.coin()) standing.distribute();
      std::shared_ptr<ContactBase> contact = makeSole(frameName(trial % 4));
      if ((trial % 2 == 0) == last_is_point) contact = makePoint(frameName(trial % 4));
      names.push_back("a contact that was added in trial " + std::to_string(trial));
      dynacom.addContact(contact, names.back(), standing.random.coin());
      BOOST_TEST_CONTEXT("trial " << trial)
      BOOST_TEST(allocationsIn([&] { standing.distribute(); }) == 0);
      checkThatActivationAllocatesNothing(dynacom, names, standing.random);
    }
  }
}

BOOST_AUTO_TEST_CASE(measured_placements_and_known_motions_allocate_nothing) {
  for (const auto feet : kAllFeet) {
    Standing standing(feet);
    DynaCoM& dynacom = standing.dynacom;
    pinocchio::Data data(standing.model);
    for (int trial = 0; trial < 40; ++trial) {
      const std::string& name =
          standing.names[standing.random.integer(0, Index(standing.names.size()) - 1)];
      const State x = standing.moving();
      const SE3 pose = standing.random.placement();
      runCentroidalDynamics(standing.model, data, x);
      BOOST_TEST(allocationsIn([&] { dynacom.setContactPose(name, pose); }) == 0);
      BOOST_TEST(allocationsIn([&] { dynacom.computeDynamics(data); }) == 0);
      BOOST_TEST(allocationsIn([&] { dynacom.computeDynamics(data, Vector6::Ones(), false); }) ==
                 0);
      BOOST_TEST(allocationsIn(
                     [&] { dynacom.computeDynamics(data, Vector6::Ones(), GroundPlane()); }) == 0);
      BOOST_TEST(allocationsIn([&] { standing.distribute(); }) == 0);
      BOOST_TEST(allocationsIn([&] { dynacom.resetContactPose(name); }) == 0);
      BOOST_TEST(allocationsIn([&] { standing.compute(x); }) == 0);
      BOOST_TEST(dynacom.getDistribution().isOptimal());
    }
  }
}

BOOST_AUTO_TEST_CASE(settings_changed_in_the_loop_allocate_nothing) {
  for (const auto feet : kAllFeet) {
    Standing standing(feet);
    DynaCoM& dynacom = standing.dynacom;
    for (int trial = 0; trial < 40; ++trial) {
      ContactBase& contact = *dynacom.getContact(standing.names[0]);
      const double value = standing.random.uniform(0.1, 1.);
      BOOST_TEST(allocationsIn([&] {
                   if (auto* sole = dynamic_cast<Contact6D*>(&contact)) {
                     sole->setMu(value);
                     sole->setGu(0.1 * value);
                     sole->setForceWeights(Vector3d::Constant(value));
                     sole->setTorqueWeights(Vector3d::Constant(value));
                     sole->setSurfaceHalfLength(0.2 * value);
                     sole->setSurfaceHalfWidth(0.1 * value);
                   } else {
                     auto& point = dynamic_cast<ContactPoint&>(contact);
                     point.setMu(value);
                     point.setForceWeights(Vector3d::Constant(value));
                   }
                   dynacom.setWarmStart(trial % 3 > 0);
                   dynacom.setMaximalIterations(1 + trial);
                   dynacom.setMinimalVerticalForce(value);
                   dynacom.setGroundHeight(value);
                   dynacom.setWrenchWeights(Vector6::Constant(value));
                 }) == 0);
      const State x = standing.moving();
      BOOST_TEST(allocationsIn([&] { standing.compute(x); }) == 0);
      BOOST_TEST(allocationsIn([&] { standing.distribute(); }) == 0);
    }
  }
}

BOOST_AUTO_TEST_CASE(wrenches_for_the_robust_solvers_allocate_nothing) {
  for (const auto feet : kAllFeet) {
    for (const bool warm : {false, true}) {
      Standing standing(feet);
      DynaCoM& dynacom = standing.dynacom;
      dynacom.setWarmStart(warm);
      // With weights so far apart, rounding decides what is next to the boundary.
      dynacom.setWrenchWeights((Vector6() << 1., 1., 1., 1e4, 1e4, 1e4).finished());
      standing.compute(restState(standing.model));
      std::array<int, 4> asked{};
      for (int trial = 0; trial < 100; ++trial) {
        const std::string& name =
            standing.names[standing.random.integer(0, Index(standing.names.size()) - 1)];
        if (trial % 3 > 0)
          dynacom.activateContact(name);
        else
          dynacom.deactivateContact(name);
        // Friction of 0.7 where all stand level: next to what they can give, on either side.
        const double beyond =
            std::pow(10., standing.random.uniform(-12., -4.)) * (standing.random.coin() ? 1. : -1.);
        Vector6 wrench = Vector6::Zero();
        for (const auto& contact : standing.activeContacts()) {
          const double normal = standing.random.uniform(50., 200.);
          wrench +=
              normal * (contact->ne_A().col(2) + 0.7 * (1. + beyond) * contact->ne_A().col(0));
          wrench += 0.3 * normal * contact->ne_A().col(1);
        }
        auto status = DistributionStatus::NoContact;
        BOOST_TEST(allocationsIn([&] {
                     status = dynacom.distributeForce(wrench.head<3>(), wrench.tail<3>(),
                                                      dynacom.getCoM());
                   }) == 0);
        BOOST_TEST(dynacom.getDistribution().isOptimal());
        if (!warm && !wrench.isZero(0.)) ++asked[countAskedSolvers(dynacom.getDistribution())];
      }
      if (warm) continue;
      BOOST_TEST(asked[0] == 0);
      BOOST_TEST(asked[1] > 5);
      BOOST_TEST(asked[3] > 5);
    }
  }
}

BOOST_AUTO_TEST_CASE(reserved_slots_allocate_nothing_from_the_first_time_on) {
  // Problems of every sort: points and soles in changing order, contacts nearly parallel, weights
  // far apart, next to the boundary.
  ProblemGenerator generator(5);
  Random random(5);
  Tally tally;
  std::array<int, 4> asked{};
  for (int trial = 0; trial < 1500; ++trial) {
    const Problem problem = generator.next();
    const auto contacts = problem.makeContacts();
    WrenchDistribution distribution;
    for (std::size_t slot = 0; slot < contacts.size(); ++slot)
      distribution.reserve(*contacts[slot], slot);
    distribution.setWrenchWeights(problem.wrench_weights);
    distribution.setWarmStart(random.coin());
    if (trial % 3 == 0) {
      WrenchDistribution copy = distribution;
      distribution = copy;
    }
    std::vector<std::size_t> slots(contacts.size());
    for (std::size_t slot = 0; slot < slots.size(); ++slot) slots[slot] = slot;
    for (int subset = 0; subset < 4; ++subset) {
      // All of them last.
      for (std::size_t k = slots.size() - 1; k > 0; --k)
        std::swap(slots[k], slots[random.integer(0, Index(k))]);
      const std::size_t size = subset == 3 ? slots.size() : random.integer(1, Index(slots.size()));
      auto status = DistributionStatus::NoContact;
      BOOST_TEST_CONTEXT("problem " << trial)
      BOOST_TEST(allocationsIn([&] {
                   distribution.clear();
                   for (std::size_t k = 0; k < size; ++k)
                     distribution.add(*contacts[slots[k]], slots[k]);
                   status = distribution.solve(problem.wrench, problem.minimal_scale);
                 }) == 0);
      ++tally[status];
      if (!distribution.getWarmStart() && !problem.wrench.isZero(0.))
        ++asked[countAskedSolvers(distribution.result())];
    }
  }
  BOOST_TEST(tally[DistributionStatus::Solved] > 500);
  BOOST_TEST(tally[DistributionStatus::Relaxed] > 500);
  BOOST_TEST(asked[0] == 0);
  BOOST_TEST(asked[1] > 500);
  BOOST_TEST(asked[2] > 20);
  BOOST_TEST(asked[3] > 50);
  BOOST_TEST_MESSAGE(asked[1] << " by Newton's method, " << asked[2] << " by the robust solver, "
                              << asked[3] << " by that with more digits");
}

BOOST_AUTO_TEST_CASE(a_distribution_of_the_same_sizes_allocates_nothing) {
  // Wrenches at the limit of friction, so that inequalities become active, and leave again; on the
  // boundary; and beyond it.
  for (const auto feet : kAllFeet) {
    Standing standing(feet);
    standing.compute(restState(standing.model));
    const auto contacts = standing.activeContacts();
    WrenchDistribution distribution;
    for (std::size_t slot = 0; slot < contacts.size(); ++slot)
      distribution.reserve(*contacts[slot], slot);
    const auto solve = [&](const Vector6& wrench) {
      auto status = DistributionStatus::NoContact;
      const int allocated = allocationsIn([&] {
        distribution.clear();
        for (const auto& contact : contacts) distribution.add(*contact);
        status = distribution.solve(wrench);
      });
      BOOST_TEST(allocated == 0);
      return status;
    };
    for (int trial = 0; trial < 200; ++trial) {
      Vector6 within = Vector6::Zero(), boundary = Vector6::Zero();
      for (const auto& contact : contacts) {
        const double fz = standing.random.uniform(10., 300.);
        VectorXd force = VectorXd::Zero(contact->cols());
        force.head<3>() << standing.random.vector(2, 0.7 * fz), fz;
        within += contact->ne_A() * force;
        // On the same facet in all contacts, which stand level.
        force[0] = 0.7 * fz;
        boundary += contact->ne_A() * force;
      }
      BOOST_TEST(solve(within) == DistributionStatus::Solved);
      solve(boundary);
      Vector6 beyond = within;
      beyond[0] += 2. * within[2];
      BOOST_TEST(solve(beyond) == DistributionStatus::Relaxed);
      BOOST_TEST(solve(standing.random.vector(6, 1000.)) != DistributionStatus::NumericalFailure);
    }
  }
}

// --- Kept storage ----------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(moving_a_distribution_allocates_nothing) {
  Random random(9);
  WrenchDistribution distribution, other;
  for (const std::string frame : {"left", "right"}) {
    const auto sole = makeSole(frame);
    sole->updateNewtonEuler(random.vector3(), random.placement());
    distribution.add(*sole);
  }
  distribution.solve(random.vector(6, 100.));
  const VectorXd forces = distribution.result().forces();
  std::optional<WrenchDistribution> moved;
  BOOST_TEST(allocationsIn([&] { moved.emplace(std::move(distribution)); }) == 0);
  BOOST_TEST(close(moved->result().forces(), forces, 0.));
}

BOOST_AUTO_TEST_CASE(kept_storage_allocates_only_to_become_larger_than_ever) {
  using dynacom::internal::Kept;
  using dynacom::internal::KeptList;
  using KeptMatrix = Kept<Eigen::MatrixXd>;
  using KeptVector = Kept<Eigen::VectorXd>;
  BOOST_TEST(allocationsIn([] {
               KeptMatrix matrix;
               KeptVector vector;
             }) == 0);
  const Eigen::MatrixXd large = Eigen::MatrixXd::Ones(6, 8), small = Eigen::MatrixXd::Ones(2, 3),
                        tall = Eigen::MatrixXd::Ones(48, 1);
  KeptMatrix matrix, other;
  BOOST_TEST(allocationsIn([&] { matrix.resize(6, 8); }) > 0);
  BOOST_TEST(allocationsIn([&] {
               for (const Eigen::MatrixXd* one : {&large, &small, &tall, &small, &large})
                 matrix = *one;
               for (Eigen::Index rows = 0; rows <= 6; ++rows)
                 for (Eigen::Index cols = 8; cols >= 0; --cols) {
                   matrix.resize(rows, cols);
                   matrix.setZero(6 - rows, 8 - cols);
                 }
             }) == 0);
  BOOST_TEST(allocationsIn([&] { matrix.resize(7, 7); }) > 0);
  BOOST_TEST(allocationsIn([&] { matrix.resize(1, 49); }) == 0);
  other.resize(5, 10);
  BOOST_TEST(allocationsIn([&] { other = matrix; }) == 0);

  KeptVector vector;
  vector.resize(10);
  BOOST_TEST(allocationsIn([&] {
               for (const Eigen::Index size : {3, 0, 10, 7}) vector.setConstant(size, 1.);
             }) == 0);

  KeptList<KeptVector> list;
  list.resize(3);
  for (std::size_t k = 0; k < 3; ++k) list[k].setZero(4);
  BOOST_TEST(allocationsIn([&] {
               for (const std::size_t size : {1, 0, 2, 3}) list.resize(size);
               list[1].setZero(2);
               list[1].setZero(4);
             }) == 0);
}

BOOST_AUTO_TEST_CASE(problems_of_sets_that_change_allocate_nothing) {
  for (std::size_t kind = 0; kind < kSetKindNames.size(); ++kind) {
    SetProblemGenerator generator(5);
    DistributionSolver solver;
    for (int trial = 0; trial < 50; ++trial) {
      SetProblem made = generator.next(static_cast<SetKind>(kind));
      solver.solve(made.problem);
      made.problem.wrench *= 1.01;
      made.problem.contacts[0].lever.x() += 0.001;
      BOOST_TEST(allocationsIn([&] { solver.solve(made.problem); }) == 0);
    }
  }
}

BOOST_AUTO_TEST_CASE(contacts_of_sets_share_wrenches_without_allocating) {
  Contact6DSettings settings = makeSole("foot")->getSettings();
  settings.friction = FrictionModel::Facets;
  settings.greatest_normal_force = 700.;
  Contact6D left(settings), right(settings);
  WrenchDistribution distribution;
  const auto tick = [&](double x) {
    for (const auto& [contact, y] : {std::pair(&left, 0.1), std::pair(&right, -0.1)})
      contact->updateNewtonEuler({x, 0., 0.9}, {Matrix3d::Identity(), Vector3d(0., y, 0.)});
    distribution.clear();
    distribution.add(left);
    distribution.add(right);
    Vector6 wrench = Vector6::Unit(2) * 900.;
    wrench[0] = 4000. * x;
    wrench[4] = -0.9 * wrench[0];
    distribution.solve(wrench);
  };
  tick(0.);
  for (int k = 0; k < 50; ++k)
    BOOST_TEST(allocationsIn([&] { tick(0.01 * std::sin(0.1 * k)); }) == 0);
}
