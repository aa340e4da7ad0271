// SPDX-License-Identifier: BSD-2-Clause
// A body on two soles that walks slowly over any ground.
#pragma once

#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "dynacom/recorded_motion.hpp"
#include "feet.hpp"
#include "random_robot.hpp"

namespace dynacom_tests {

/// A ground's height [m] as a function of x and y.
using Ground = std::function<double(double, double)>;

/// Its gradient, by differences.
inline Vector2d gradientOf(const Ground& ground, double x, double y) {
  constexpr double step = 1e-5;
  return Vector2d(ground(x + step, y) - ground(x - step, y),
                  ground(x, y + step) - ground(x, y - step)) /
         (2. * step);
}

/// 10 kg above the soles "left" and "right" of two massless feet that go wherever they are put.
struct Walker {
  Walker() {
    model = singleBody(10., {});
    for (const std::string name : {"left", "right"}) {
      const auto joint = model.addJoint(1, pinocchio::JointModelFreeFlyer(), SE3::Identity(), name);
      model.addFrame(pinocchio::Frame(name + "_foot", joint, SE3::Identity(), pinocchio::OP_FRAME));
    }
    robot.emplace(model);
    for (const std::string name : {"left", "right"})
      robot->addContact(makeSole(name + "_foot"), name);
  }

  /// Where a foot is put, in the world.
  struct Step {
    int foot;  // 0 is the left one
    SE3 place;
  };

  /// Where a foot stands flat on the ground, or level at the height below its middle.
  static SE3 onGround(const Ground& ground, double x, double y, bool is_level = false) {
    const Vector2d slope = is_level ? Vector2d(0., 0.) : gradientOf(ground, x, y);
    return SE3(
        Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), Vector3d(-slope.x(), -slope.y(), 1.)),
        Vector3d(x, y, ground(x, y)));
  }

  /// Steps of 0.25 m along x, the left foot's at y = width.
  static std::vector<Step> walkAhead(const Ground& ground, int count, double width = 0.1,
                                     bool is_level = false) {
    std::vector<Step> steps;
    for (int k = 0; k < count; ++k) {
      const int foot = k % 2;
      const double x = 0.25 * double(std::max(k - 1, 0));
      steps.push_back({foot, onGround(ground, x, foot == 0 ? width : -width, is_level)});
    }
    return steps;
  }

  /// Begins with both feet where the first two steps put them, and takes the others one by one,
  /// each within half a second, while the body is above the other foot. It takes a second and a
  /// half to get there, and in the end above the middle.
  dynacom::RecordedMotion walk(const std::vector<Step>& steps) const {
    constexpr double shift = 1.5, swing = 0.5, rate = 100.;
    const auto smooth = [](double part) {
      const double s = std::min(std::max(part, 0.), 1.);
      return s * s * s * (10. + s * (6. * s - 15.));
    };
    SE3 feet[2];
    for (const int k : {0, 1}) feet[steps[std::size_t(k)].foot] = steps[std::size_t(k)].place;
    std::vector<VectorXd> frames;
    const auto add = [&](const Vector3d& body) {
      VectorXd q(model.nq);
      q << body, Eigen::Quaterniond::Identity().coeffs(), feet[0].translation() - body,
          Eigen::Quaterniond(feet[0].rotation()).coeffs(), feet[1].translation() - body,
          Eigen::Quaterniond(feet[1].rotation()).coeffs();
      frames.push_back(q);
    };
    const Vector3d above(0., 0., 0.7);
    const auto middle = [&] {
      return Vector3d(0.5 * (feet[0].translation() + feet[1].translation()) + above);
    };
    Vector3d body = middle();
    const auto move = [&](const Vector3d& goal) {
      const Vector3d from = body;
      for (int k = 0; k < int(shift * rate); ++k) {
        body = from + smooth(double(k) / (shift * rate)) * (goal - from);
        add(body);
      }
      body = goal;
    };
    for (std::size_t k = 2; k < steps.size(); ++k) {
      const int foot = steps[k].foot;
      move(feet[1 - foot].translation() + above);
      const SE3 from = feet[foot], to = steps[k].place;
      for (int i = 0; i < int(swing * rate); ++i) {
        const double part = double(i) / (swing * rate), going = smooth(part);
        feet[foot].translation() = from.translation() +
                                   going * (to.translation() - from.translation()) +
                                   Vector3d(0., 0., 0.1 * std::pow(std::sin(M_PI * part), 2));
        feet[foot].rotation() = Eigen::Quaterniond(from.rotation())
                                    .slerp(going, Eigen::Quaterniond(to.rotation()))
                                    .toRotationMatrix();
        add(body);
      }
      feet[foot] = to;
    }
    move(middle());
    dynacom::RecordedMotion recorded;
    const auto count = Index(frames.size());
    recorded.time = VectorXd::LinSpaced(count, 0., double(count - 1) / rate);
    recorded.q.resize(model.nq, count);
    for (Index k = 0; k < count; ++k) recorded.q.col(k) = frames[std::size_t(k)];
    return recorded;
  }

  pinocchio::Model model;
  std::optional<dynacom::DynaCoM> robot;
};

/// The ground is level, rises from one x to another, and is level again.
inline Ground ramp(double degrees, double from, double to) {
  const double gradient = std::tan(degrees * M_PI / 180.);
  return [=](double x, double) { return gradient * (std::min(std::max(x, from), to) - from); };
}

}  // namespace dynacom_tests
