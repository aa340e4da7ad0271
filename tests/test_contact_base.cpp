// SPDX-License-Identifier: BSD-2-Clause
// What every contact does, shown on the two that there are and on one of our own.
#define BOOST_TEST_MODULE contact_base
#include <cmath>
#include <functional>
#include <limits>
#include <tuple>
#include <vector>

#include "dynacom/contact6d.hpp"
#include "dynacom/contact_base.hpp"
#include "dynacom/contact_point.hpp"
#include "test_tools.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

/// A contact that a user might write: a suction cup. It neither slips nor comes off, and it sits
/// at the end of a nozzle.
class SuctionCup : public ContactBase {
 public:
  SuctionCup() { initialize(); }
  void initialize() {
    setMatrices(Eigen::RowVectorXd::Unit(6, 5), MatrixXd::Ones(2, 6), Vector6::Constant(3.));
    reset();
  }
  std::shared_ptr<ContactBase> clone() const override {
    return std::make_shared<SuctionCup>(*this);
  }
  const std::string& getFrameName() const override { return name_; }
  SE3 getSurfacePose() const override {
    return getPose() * SE3(Matrix3d::Identity(), Vector3d(0., 0., -0.1));
  }

 private:
  std::string name_ = "nozzle";
};

std::shared_ptr<Contact6D> sole() {
  Contact6DSettings settings;
  settings.frame_name = "sole";
  return std::make_shared<Contact6D>(settings);
}

std::shared_ptr<ContactPoint> point() {
  ContactPointSettings settings;
  settings.frame_name = "tip";
  return std::make_shared<ContactPoint>(settings);
}

std::vector<std::shared_ptr<ContactBase>> allKinds() {
  return {sole(), point(), std::make_shared<SuctionCup>()};
}

/// What settings there are, and each of their fields changed in turn.
template <class Contact>
struct Kind;

template <>
struct Kind<Contact6D> {
  using Settings = Contact6DSettings;
  static std::vector<std::function<void(Settings&)>> changes() {
    std::vector<std::function<void(Settings&)>> list = {
        [](auto& settings) { settings.mu += 0.5; },
        [](auto& settings) { settings.gu += 0.5; },
        [](auto& settings) { settings.half_length += 0.5; },
        [](auto& settings) { settings.half_width += 0.5; },
        [](auto& settings) { settings.frame_name += "_"; },
    };
    for (Index i = 0; i < 6; ++i)
      list.push_back([i](auto& settings) { settings.weights[i] += 0.5; });
    return list;
  }
};

template <>
struct Kind<ContactPoint> {
  using Settings = ContactPointSettings;
  static std::vector<std::function<void(Settings&)>> changes() {
    std::vector<std::function<void(Settings&)>> list = {
        [](auto& settings) { settings.mu += 0.5; },
        [](auto& settings) { settings.frame_name += "_"; },
        [](auto& settings) { settings.world_aligned = !settings.world_aligned; },
        [](auto& settings) { settings.radius += 0.5; },
    };
    for (Index i = 0; i < 3; ++i)
      list.push_back([i](auto& settings) { settings.weights[i] += 0.5; });
    return list;
  }
};

using Kinds = std::tuple<Contact6D, ContactPoint>;

/// The wrench of forces about a point, by force and lever, without any matrix of six rows.
Vector6 wrenchByLevers(const SE3& oMs, const VectorXd& lambda, const Vector3d& about) {
  const Vector3d force = oMs.rotation() * lambda.head<3>();
  Vector3d moment = (oMs.translation() - about).cross(force);
  if (lambda.size() == 6) moment += oMs.rotation() * lambda.tail<3>();
  return (Vector6() << force, moment).finished();
}

}  // namespace

BOOST_AUTO_TEST_CASE(without_settings_a_contact_has_no_components) {
  Contact6D sole;
  ContactPoint point;
  for (ContactBase* contact :
       {static_cast<ContactBase*>(&sole), static_cast<ContactBase*>(&point)}) {
    BOOST_TEST(contact->cols() == 0);
    BOOST_TEST(contact->uni_rows() == 0);
    BOOST_TEST(contact->fri_rows() == 0);
    BOOST_TEST(contact->appliedForce().size() == 0);
    BOOST_TEST(contact->getFrameName().empty());
    BOOST_TEST(
        throws<std::invalid_argument>([&] { contact->applyForce(Vector3d::Zero()); }, {"3", "0"}));
  }
}

BOOST_AUTO_TEST_CASE(pose_and_frame_index_are_kept_as_given) {
  Random random(1);
  for (const auto& contact : allKinds()) {
    BOOST_TEST(contact->getFrameID() == +ContactBase::kUnknownFrame);
    BOOST_TEST(contact->getPose().isIdentity(0.));
    const SE3 pose = random.placement();
    contact->setPose(pose);
    contact->setFrameID(7);
    BOOST_TEST((contact->getPose() == pose));
    BOOST_TEST(contact->getFrameID() == 7u);
  }
}

BOOST_AUTO_TEST_CASE(sizes_agree) {
  for (const auto& contact : allKinds()) {
    BOOST_TEST(contact->uni_A().rows() == contact->uni_rows());
    BOOST_TEST(contact->uni_A().cols() == contact->cols());
    BOOST_TEST(contact->fri_A().rows() == contact->fri_rows());
    BOOST_TEST(contact->fri_A().cols() == contact->cols());
    BOOST_TEST(contact->reg_A().size() == contact->cols());
    BOOST_TEST(contact->ne_A().cols() == contact->cols());
    BOOST_TEST(close(contact->uni_b(), VectorXd::Zero(contact->uni_rows()), 0.));
    BOOST_TEST(close(contact->fri_b(), VectorXd::Zero(contact->fri_rows()), 0.));
    BOOST_TEST(close(contact->reg_b(), VectorXd::Zero(contact->cols()), 0.));
    BOOST_TEST(close(contact->appliedForce(), VectorXd::Zero(contact->cols()), 0.));
  }
}

BOOST_AUTO_TEST_CASE(newton_euler_matrix_is_the_force_adjoint_of_pinocchio) {
  Random random(2);
  for (const auto& contact : allKinds()) {
    for (int trial = 0; trial < 20; ++trial) {
      const Vector3d com = random.vector3();
      const SE3 pose = random.placement();
      contact->updateNewtonEuler(com, pose);
      BOOST_TEST((contact->getPose() == pose));

      SE3 cMs = contact->getSurfacePose();
      cMs.translation() -= com;
      const Index cols = contact->cols();
      BOOST_TEST(close(contact->ne_A(), cMs.toDualActionMatrix().leftCols(cols), 1e-14));
      BOOST_TEST(
          close(contact->ne_A(), cMs.toActionMatrixInverse().transpose().leftCols(cols), 1e-14));
    }
  }
}

BOOST_AUTO_TEST_CASE(newton_euler_matrix_is_force_and_lever) {
  // The same matrix, column by column, from f and (p − c) × f + τ.
  Random random(3);
  for (const auto& contact : allKinds()) {
    for (int trial = 0; trial < 20; ++trial) {
      const Vector3d com = random.vector3();
      contact->updateNewtonEuler(com, random.placement());
      for (Index i = 0; i < contact->cols(); ++i)
        BOOST_TEST(close(
            contact->ne_A().col(i),
            wrenchByLevers(contact->getSurfacePose(), VectorXd::Unit(contact->cols(), i), com),
            1e-14));
    }
  }
}

BOOST_AUTO_TEST_CASE(applied_force_is_kept_until_deactivated) {
  Random random(4);
  for (const auto& contact : allKinds()) {
    const VectorXd force = random.vector(contact->cols(), 100.);
    contact->applyForce(force);
    BOOST_TEST(close(contact->appliedForce(), force, 0.));
    contact->deactivate();
    BOOST_TEST(close(contact->appliedForce(), VectorXd::Zero(contact->cols()), 0.));
    BOOST_TEST(close(contact->toWorldForces(), Vector6::Zero(), 0.));
    BOOST_TEST(close(contact->toCoMForces(), Vector6::Zero(), 0.));
  }
}

BOOST_AUTO_TEST_CASE(force_of_the_wrong_size_is_refused_and_changes_nothing) {
  Random random(5);
  for (const auto& contact : allKinds()) {
    const Index cols = contact->cols();
    const VectorXd force = random.vector(cols, 100.);
    contact->applyForce(force);
    for (const Index wrong : {Index(0), cols - 1, cols + 1})
      BOOST_TEST(throws<std::invalid_argument>([&] { contact->applyForce(VectorXd::Ones(wrong)); },
                                               {std::to_string(cols), std::to_string(wrong)}));
    BOOST_TEST(close(contact->appliedForce(), force, 0.));
  }
}

BOOST_AUTO_TEST_CASE(forces_in_the_world_are_about_its_origin) {
  Random random(6);
  for (const auto& contact : allKinds()) {
    for (int trial = 0; trial < 20; ++trial) {
      contact->setPose(random.placement());
      const VectorXd force = random.vector(contact->cols(), 100.);
      contact->applyForce(force);
      BOOST_TEST(close(contact->toWorldForces(),
                       wrenchByLevers(contact->getSurfacePose(), force, Vector3d::Zero())));
    }
  }
}

BOOST_AUTO_TEST_CASE(forces_at_the_com_are_about_the_last_com) {
  Random random(7);
  for (const auto& contact : allKinds()) {
    for (int trial = 0; trial < 20; ++trial) {
      const Vector3d com = random.vector3();
      const VectorXd force = random.vector(contact->cols(), 100.);
      contact->applyForce(force);
      contact->updateNewtonEuler(com, random.placement());
      BOOST_TEST(
          close(contact->toCoMForces(), wrenchByLevers(contact->getSurfacePose(), force, com)));
    }
  }
}

BOOST_AUTO_TEST_CASE(centre_of_pressure_is_where_the_moment_is_about_the_normal_only) {
  Random random(8);
  for (const auto& contact : allKinds()) {
    for (int trial = 0; trial < 20; ++trial) {
      contact->setPose(random.placement());
      VectorXd force = random.vector(contact->cols(), 100.);
      force.z() = random.uniform(50., 100.);
      contact->applyForce(force);

      const Vector2d cop = contact->getCoP();
      // The moment about it is what the moment about the origin is, less p × f.
      const Vector3d torque = contact->cols() == 6 ? Vector3d(force.tail<3>()) : Vector3d::Zero();
      const Vector3d there =
          torque - Vector3d(cop.x(), cop.y(), 0.).cross(Vector3d(force.head<3>()));
      BOOST_TEST(close(there.head<2>(), Vector2d::Zero(), 1e-10));
    }
  }
}

BOOST_AUTO_TEST_CASE(nothing_presses_without_a_positive_normal_force) {
  for (const auto& contact : allKinds()) {
    BOOST_TEST(allNaN(contact->getCoP()));
    VectorXd force = VectorXd::Ones(contact->cols());
    force.z() = -1.;
    contact->applyForce(force);
    BOOST_TEST(allNaN(contact->getCoP()));
    force.z() = std::numeric_limits<double>::quiet_NaN();
    contact->applyForce(force);
    BOOST_TEST(allNaN(contact->getCoP()));
  }
}

BOOST_AUTO_TEST_CASE(kinds_without_a_limit_use_none_of_it) {
  const auto check = [](const ContactBase& contact, bool friction, bool edges, bool yaw) {
    BOOST_TEST(std::isnan(contact.getFrictionUsage()) == !friction);
    BOOST_TEST(std::isnan(contact.getCoPMargin()) == !edges);
    BOOST_TEST(std::isnan(contact.getYawUsage()) == !yaw);
  };
  SuctionCup cup;
  cup.applyForce(Vector6::Ones());
  check(cup, false, false, false);

  // Of a point, there is friction; of a sole, all, as far as its settings are not zero.
  const auto tip = point();
  tip->setMu(0.5);
  tip->applyForce(Vector3d::Ones());
  check(*tip, true, false, false);
  const auto foot = sole();
  foot->applyForce(Vector6::Ones());
  check(*foot, false, true, false);
  foot->setMu(0.5);
  check(*foot, true, true, false);
  foot->setGu(0.5);
  check(*foot, true, true, true);
  check(Contact6D(), false, false, false);
  check(ContactPoint(), false, false, false);
}

BOOST_AUTO_TEST_CASE(without_force_nothing_is_used) {
  const auto tip = point();
  const auto foot = sole();
  tip->setMu(0.5);
  foot->setMu(0.5);
  foot->setGu(0.5);
  BOOST_TEST(tip->getFrictionUsage() == 0.);
  BOOST_TEST(foot->getFrictionUsage() == 0.);
  BOOST_TEST(foot->getYawUsage() == 0.);
  BOOST_TEST(std::isnan(foot->getCoPMargin()));
  // Where there is never anything to use, the force makes no difference.
  tip->setMu(0.);
  foot->setMu(0.);
  foot->setGu(0.);
  BOOST_TEST(std::isnan(tip->getFrictionUsage()));
  BOOST_TEST(std::isnan(foot->getFrictionUsage()));
  BOOST_TEST(std::isnan(foot->getYawUsage()));
  // A deactivated contact is back there.
  foot->setMu(0.5);
  foot->applyForce((Vector6() << 10., 0., 100., 0., 0., 0.).finished());
  BOOST_TEST(foot->getFrictionUsage() > 0.);
  foot->deactivate();
  BOOST_TEST(foot->getFrictionUsage() == 0.);
  BOOST_TEST(std::isnan(foot->getCoPMargin()));
}

BOOST_AUTO_TEST_CASE(clone_has_everything_and_shares_nothing) {
  Random random(9);
  for (const auto& contact : allKinds()) {
    const Index cols = contact->cols();
    const SE3 pose = random.placement();
    const Vector3d com = random.vector3();
    const VectorXd force = random.vector(cols, 100.);
    contact->setFrameID(5);
    contact->applyForce(force);
    contact->updateNewtonEuler(com, pose);

    const auto copy = contact->clone();
    BOOST_TEST(copy != contact);
    BOOST_TEST(copy->getFrameName() == contact->getFrameName());
    BOOST_TEST(copy->getFrameID() == 5u);
    BOOST_TEST((copy->getPose() == pose));
    BOOST_TEST(close(copy->appliedForce(), force, 0.));
    BOOST_TEST(close(copy->ne_A(), contact->ne_A(), 0.));
    BOOST_TEST(close(copy->uni_A(), contact->uni_A(), 0.));
    BOOST_TEST(close(copy->fri_A(), contact->fri_A(), 0.));
    BOOST_TEST(close(copy->reg_A(), contact->reg_A(), 0.));

    const MatrixXd ne = copy->ne_A();
    contact->deactivate();
    contact->setFrameID(6);
    contact->updateNewtonEuler(random.vector3(), random.placement());
    BOOST_TEST(copy->getFrameID() == 5u);
    BOOST_TEST((copy->getPose() == pose));
    BOOST_TEST(close(copy->appliedForce(), force, 0.));
    BOOST_TEST(close(copy->ne_A(), ne, 0.));
  }
}

BOOST_AUTO_TEST_CASE(reset_forgets_frame_index_and_force) {
  SuctionCup cup;
  cup.setFrameID(3);
  cup.applyForce(Vector6::Ones());
  cup.initialize();
  BOOST_TEST(cup.getFrameID() == +ContactBase::kUnknownFrame);
  BOOST_TEST(close(cup.appliedForce(), Vector6::Zero(), 0.));
}

BOOST_AUTO_TEST_CASE_TEMPLATE(settings_compare_and_print_by_every_field, Contact, Kinds) {
  typename Kind<Contact>::Settings settings;
  settings.frame_name = "tip";
  const auto same = settings;
  BOOST_TEST((settings == same));
  BOOST_TEST(!(settings != same));
  BOOST_TEST(settings.to_string() == same.to_string());
  for (const auto& change : Kind<Contact>::changes()) {
    auto other = settings;
    change(other);
    BOOST_TEST((settings != other));
    BOOST_TEST(!(settings == other));
    BOOST_TEST(settings.to_string() != other.to_string());
  }
}

BOOST_AUTO_TEST_CASE_TEMPLATE(initialize_may_be_called_again, Contact, Kinds) {
  typename Kind<Contact>::Settings settings;
  settings.frame_name = "tip";
  Contact contact;
  for (const auto& change : Kind<Contact>::changes()) {
    change(settings);
    contact.initialize(settings);
    BOOST_TEST((contact.getSettings() == settings));
    BOOST_TEST(contact.getFrameName() == settings.frame_name);
    const Contact fresh(settings);
    BOOST_TEST(close(contact.uni_A(), fresh.uni_A(), 0.));
    BOOST_TEST(close(contact.fri_A(), fresh.fri_A(), 0.));
    BOOST_TEST(close(contact.reg_A(), fresh.reg_A(), 0.));
    // What belonged to the settings before is forgotten.
    BOOST_TEST(close(contact.appliedForce(), VectorXd::Zero(contact.cols()), 0.));
    BOOST_TEST(contact.getFrameID() == +ContactBase::kUnknownFrame);
    contact.applyForce(VectorXd::Ones(contact.cols()));
    contact.setFrameID(4);
  }
}

BOOST_AUTO_TEST_CASE_TEMPLATE(clone_has_settings_of_its_own, Contact, Kinds) {
  typename Kind<Contact>::Settings settings;
  settings.frame_name = "tip";
  Contact contact(settings);
  const auto copy = std::dynamic_pointer_cast<Contact>(contact.clone());
  BOOST_REQUIRE(copy);
  contact.setMu(0.5);
  BOOST_TEST((copy->getSettings() == settings));
  BOOST_TEST(close(copy->fri_A(), Contact(settings).fri_A(), 0.));

  copy->setMu(3.);
  BOOST_TEST(contact.getSettings().mu == 0.5);
}
