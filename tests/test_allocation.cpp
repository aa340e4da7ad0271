// SPDX-License-Identifier: BSD-2-Clause
// In a control loop nothing allocates. Eigen's own check for that does not see into libraries, so
// this counts at malloc: a function of that name in the executable takes the place of the C
// library's for all shared libraries, too, and operator new ends there.
#define BOOST_TEST_MODULE allocation
#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <new>

#include "dynacom/contact6d.hpp"
#include "dynacom/contact_point.hpp"
#include "dynacom/dyna_com.hpp"
#include "feet.hpp"
#include "random_robot.hpp"

namespace {

std::atomic<bool> counting{false};
std::atomic<int> allocations{0};

void count() {
  if (counting) ++allocations;
}

}  // namespace

// Those of the GNU C library, under the names that it keeps for this purpose.
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t number, std::size_t size);
void* __libc_realloc(void* pointer, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

#define VISIBLE __attribute__((visibility("default")))

VISIBLE void* malloc(std::size_t size) noexcept {
  count();
  return __libc_malloc(size);
}

VISIBLE void* calloc(std::size_t number, std::size_t size) noexcept {
  count();
  return __libc_calloc(number, size);
}

VISIBLE void* realloc(void* pointer, std::size_t size) noexcept {
  count();
  return __libc_realloc(pointer, size);
}

VISIBLE void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  count();
  return __libc_memalign(alignment, size);
}

VISIBLE void* memalign(std::size_t alignment, std::size_t size) noexcept {
  count();
  return __libc_memalign(alignment, size);
}

VISIBLE int posix_memalign(void** pointer, std::size_t alignment, std::size_t size) noexcept {
  count();
  *pointer = __libc_memalign(alignment, size);
  return *pointer ? 0 : ENOMEM;
}
}

using namespace dynacom;
using namespace dynacom_tests;

namespace {

template <class Action>
int allocationsIn(Action action) {
  allocations = 0;
  counting = true;
  action();
  counting = false;
  return allocations;
}

/// A robot on two soles or four points, with contacts that are known but take no part.
struct Standing {
  explicit Standing(bool onPoints)
      : random(1), model(standingRobot(random, stance(onPoints ? 4 : 2))), dynacom(model) {
    for (int i = 0; i < (onPoints ? 4 : 2); ++i) {
      const std::string frame = "sole" + std::to_string(i);
      for (const bool active : {true, false}) {
        std::shared_ptr<ContactBase> contact = makeSole(frame);
        if (onPoints) {
          ContactPointSettings settings = makePoint(frame)->getSettings();
          settings.world_aligned = i % 2 == 0;
          settings.radius = 0.01;
          contact = std::make_shared<ContactPoint>(settings);
        }
        dynacom.addContact(contact, frame + (active ? "" : " idle"), active);
      }
    }
    warmUp();
  }

  State moving() { return randomState(model, random, 0.02); }

  /// One call, in which everything takes its size. It is at rest, so that the wrench is in reach.
  void warmUp() {
    const State x = restState(model);
    dynacom.computeNL(3., x.q, x.v, x.a, Vector6::Zero(), false);
  }

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
};

}  // namespace

BOOST_AUTO_TEST_CASE(the_counter_sees_into_libraries) {
  Standing standing(false);
  DynaCoM& dynacom = standing.dynacom;
  // Functions of the shared library, of which each has to allocate: a std::vector of std::string,
  // an Eigen matrix, a contact.
  BOOST_TEST(allocationsIn([&] { dynacom.getActiveContacts(); }) > 0);
  BOOST_TEST(allocationsIn([&] { dynacom.uni_A(); }) > 0);
  BOOST_TEST(allocationsIn([&] { dynacom.getContact("sole0")->clone(); }) > 0);
  // And of Pinocchio's.
  BOOST_TEST(allocationsIn([&] { pinocchio::Data data(dynacom.getModel()); }) > 10);
  // In the executable, each way in.
  void* volatile pointer = nullptr;
  BOOST_TEST(allocationsIn([&] { pointer = std::malloc(8); }) == 1);
  std::free(pointer);
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
  for (const bool onPoints : {false, true}) {
    Standing standing(onPoints);
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
      if (status == DistributionStatus::Solved) ++solved;
    }
    BOOST_TEST(solved > 10);
  }
}

BOOST_AUTO_TEST_CASE(what_goes_wrong_in_the_world_allocates_nothing) {
  for (const bool onPoints : {false, true}) {
    Standing standing(onPoints);
    DynaCoM& dynacom = standing.dynacom;
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

    // No contact at all, after a first time without.
    for (const auto& name : dynacom.getActiveContacts()) dynacom.deactivateContact(name);
    standing.warmUp();
    BOOST_TEST(distribute({0., 0., 500.}) == 0);
    BOOST_TEST(status == DistributionStatus::NoContact);
  }
}

BOOST_AUTO_TEST_CASE(motions_out_of_reach_allocate_nothing) {
  for (const bool onPoints : {false, true}) {
    Standing standing(onPoints);
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
  Standing standing(false);
  DynaCoM& dynacom = standing.dynacom;
  const std::string name = "sole0";
  double sum = 0.;
  BOOST_TEST(allocationsIn([&] {
               sum += dynacom.getMass() + dynacom.getGroundHeight() + dynacom.getCoM().x() +
                      dynacom.getVCoM().x() + dynacom.getACoM().x() + dynacom.getAM().x() +
                      dynacom.getAMVariation().x() + dynacom.getGroundCoMForce().x() +
                      dynacom.getGroundCoMTorque().x() + dynacom.getCoP().x() +
                      dynacom.getVRP().x() + dynacom.getNL().x() + dynacom.ne_b().x() +
                      dynacom.getFeasibleACoM().x() + dynacom.getFeasibleAMVariation().x() +
                      dynacom.getMinimalVerticalForce() + dynacom.getWrenchWeights()[0] +
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
                      dynacom.getContactCoPMargin(name) + dynacom.getContactYawUsage(name);
             }) == 0);
  BOOST_TEST(std::isfinite(sum));
}

BOOST_AUTO_TEST_CASE(what_dynacom_does_to_contacts_allocates_nothing) {
  // A controller that has contacts of its own does it, too.
  Standing standing(false);
  auto& sole = dynamic_cast<Contact6D&>(*standing.dynacom.getContact("sole0"));
  const Vector6 force = Vector6::Ones();
  BOOST_TEST(allocationsIn([&] {
               sole.applyForce(force);
               sole.deactivate();
               sole.updateNewtonEuler(Vector3d::Zero(), SE3::Identity());
             }) == 0);
}

BOOST_AUTO_TEST_CASE(a_distribution_of_the_same_sizes_allocates_nothing) {
  // Wrenches at the limit of friction, so that inequalities become active, and leave again; on the
  // boundary; and beyond it.
  for (const bool onPoints : {false, true}) {
    Standing standing(onPoints);
    const auto contacts = standing.activeContacts();
    WrenchDistribution distribution;
    const auto solve = [&](const Vector6& wrench, int trial) {
      auto status = DistributionStatus::NoContact;
      const int allocated = allocationsIn([&] {
        distribution.clear();
        for (const auto& contact : contacts) distribution.add(*contact);
        status = distribution.solve(wrench);
      });
      if (trial > 0) BOOST_TEST(allocated == 0);
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
      BOOST_TEST(solve(within, trial) == DistributionStatus::Solved);
      solve(boundary, trial);
      Vector6 beyond = within;
      beyond[0] += 2. * within[2];
      BOOST_TEST(solve(beyond, trial) == DistributionStatus::Relaxed);
      BOOST_TEST(solve(standing.random.vector(6, 1000.), trial) !=
                 DistributionStatus::NumericalFailure);
    }
  }
}
