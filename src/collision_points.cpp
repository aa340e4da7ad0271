// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/collision_points.hpp"

#include <coal/BVH/BVH_model.h>
#include <coal/mesh_loader/loader.h>
#include <urdf_model/link.h>
#include <urdf_model/model.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <filesystem>
#include <pinocchio/algorithm/frames.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/parsers/utils.hpp>

#include "contact_frame.hpp"
#include "dynacom/contact6d.hpp"
#include "urdf.hpp"

namespace dynacom {

namespace {

using Eigen::Index;
using pinocchio::SE3;

// A link's points are complete if they are this close to its extreme ones [m], in this many
// directions, or if there are so many.
constexpr double kTolerance = 0.01;
constexpr Index kDirections = 512;
constexpr std::size_t kMostPoints = 48;
// Circles are regular polygons of so many corners.
constexpr int kCorners = 16;
// What is this close to a described contact belongs to it [m].
constexpr double kContactReach = 0.12;

const double kPi = std::acos(-1.);

struct Ball {
  Eigen::Vector3d center;
  double radius;
};

// Evenly spread, on a spiral by the golden angle.
Eigen::Matrix3Xd makeDirections() {
  Eigen::Matrix3Xd directions(3, kDirections);
  const double golden = kPi * (3. - std::sqrt(5.));
  for (Index k = 0; k < kDirections; ++k) {
    const double z = 1. - (2. * double(k) + 1.) / double(kDirections);
    const double width = std::sqrt(1. - z * z), angle = golden * double(k);
    directions.col(k) << width * std::cos(angle), width * std::sin(angle), z;
  }
  return directions;
}

// The few balls whose hull is close to that of all.
std::vector<Ball> chooseExtreme(const std::vector<Ball>& balls) {
  static const Eigen::Matrix3Xd directions = makeDirections();
  Eigen::VectorXd farthest = Eigen::VectorXd::Constant(kDirections, -1e300);
  std::vector<std::size_t> extreme(static_cast<std::size_t>(kDirections), 0);
  for (std::size_t i = 0; i < balls.size(); ++i) {
    const Eigen::VectorXd reach =
        (directions.transpose() * balls[i].center).array() + balls[i].radius;
    for (Index k = 0; k < kDirections; ++k)
      if (reach[k] > farthest[k]) {
        farthest[k] = reach[k];
        extreme[static_cast<std::size_t>(k)] = i;
      }
  }
  std::vector<Ball> chosen;
  Eigen::VectorXd lacking = Eigen::VectorXd::Constant(kDirections, 1e300);
  while (!balls.empty() && chosen.size() < kMostPoints) {
    Index worst;
    if (lacking.maxCoeff(&worst) <= kTolerance) break;
    const Ball& ball = balls[extreme[static_cast<std::size_t>(worst)]];
    chosen.push_back(ball);
    lacking = lacking.array().min(farthest.array() -
                                  (directions.transpose() * ball.center).array() - ball.radius);
  }
  return chosen;
}

SE3 toPlacement(const urdf::Pose& pose) {
  const urdf::Rotation& r = pose.rotation;
  return SE3(Eigen::Quaterniond(r.w, r.x, r.y, r.z).normalized().toRotationMatrix(),
             Eigen::Vector3d(pose.position.x, pose.position.y, pose.position.z));
}

// Where files that URDFs name may be.
std::vector<std::string> findFolders(const std::string& urdf,
                                     const std::vector<std::string>& others) {
  std::vector<std::string> folders;
  if (!internal::isXml(urdf)) {
    std::error_code error;
    for (std::filesystem::path folder = std::filesystem::canonical(urdf, error).parent_path();
         !error && !folder.empty(); folder = folder.parent_path()) {
      folders.push_back(folder.string());
      if (folder == folder.root_path()) break;
    }
  }
  folders.insert(folders.end(), others.begin(), others.end());
  return folders;
}

class GeometryReader {
 public:
  GeometryReader(std::vector<std::string> folders, std::vector<std::string>& missing)
      : folders_(std::move(folders)), missing_(missing) {}

  // Adds what a geometry is made of, in the frame that `placement` places it in.
  void read(const urdf::Geometry& geometry, const SE3& placement, std::vector<Ball>& balls) {
    const auto add = [&](double x, double y, double z, double radius = 0.) {
      balls.push_back({placement.act(Eigen::Vector3d(x, y, z)), radius});
    };
    if (const auto* sphere = dynamic_cast<const urdf::Sphere*>(&geometry)) {
      add(0., 0., 0., sphere->radius);
    } else if (const auto* box = dynamic_cast<const urdf::Box*>(&geometry)) {
      for (const double x : {-0.5, 0.5})
        for (const double y : {-0.5, 0.5})
          for (const double z : {-0.5, 0.5}) add(x * box->dim.x, y * box->dim.y, z * box->dim.z);
    } else if (const auto* cylinder = dynamic_cast<const urdf::Cylinder*>(&geometry)) {
      for (const double end : {-0.5, 0.5})
        for (int k = 0; k < kCorners; ++k) {
          const double angle = 2. * kPi * k / kCorners;
          add(cylinder->radius * std::cos(angle), cylinder->radius * std::sin(angle),
              end * cylinder->length);
        }
    } else if (const auto* mesh = dynamic_cast<const urdf::Mesh*>(&geometry)) {
      readMesh(*mesh, placement, balls);
    }
  }

 private:
  void readMesh(const urdf::Mesh& mesh, const SE3& placement, std::vector<Ball>& balls) {
    try {
      const std::string path = pinocchio::retrieveResourcePath(mesh.filename, folders_);
      if (!path.empty()) {
        // Of its bounding volumes nothing is needed.
        const auto model =
            coal::MeshLoader(coal::BV_AABB)
                .load(path, Eigen::Vector3d(mesh.scale.x, mesh.scale.y, mesh.scale.z));
        if (model && model->vertices && !model->vertices->empty()) {
          for (const auto& vertex : *model->vertices)
            balls.push_back({placement.act(Eigen::Vector3d(vertex)), 0.});
          return;
        }
      }
    } catch (const std::exception&) {  // readers of meshes promise no types
    }
    if (std::find(missing_.begin(), missing_.end(), mesh.filename) == missing_.end())
      missing_.push_back(mesh.filename);
  }

  const std::vector<std::string> folders_;
  std::vector<std::string>& missing_;
};

// The described contacts, in the neutral posture.
class ContactPlaces {
 public:
  explicit ContactPlaces(const DynaCoM& robot) : model_(robot.getModel()), data_(model_) {
    pinocchio::forwardKinematics(model_, data_, pinocchio::neutral(model_));
    for (const std::string& name : robot.getKnownContacts()) {
      const ContactBase& contact = *robot.getContact(name);
      const pinocchio::Frame& frame = internal::getFrame(model_, contact, name);
      Eigen::Vector2d half = Eigen::Vector2d::Zero();
      if (const auto* surface = dynamic_cast<const Contact6D*>(&contact))
        half << surface->getSettings().half_length, surface->getSettings().half_width;
      places_.push_back({frame.parentJoint, data_.oMi[frame.parentJoint] * frame.placement, half});
    }
  }

  bool own(pinocchio::JointIndex joint, const Ball& ball) const {
    for (const Place& place : places_) {
      if (!carries(joint, place.joint) && !carries(place.joint, joint)) continue;
      Eigen::Vector3d off = place.pose.actInv(data_.oMi[joint].act(ball.center));
      for (int axis = 0; axis < 2; ++axis)
        off[axis] -= std::clamp(off[axis], -place.half[axis], place.half[axis]);
      if (off.norm() - ball.radius <= kContactReach) return true;
    }
    return false;
  }

 private:
  struct Place {
    pinocchio::JointIndex joint;
    SE3 pose;
    Eigen::Vector2d half;
  };

  bool carries(pinocchio::JointIndex one, pinocchio::JointIndex other) const {
    while (other > one) other = model_.parents[other];
    return one == other;
  }

  const pinocchio::Model& model_;
  pinocchio::Data data_;
  std::vector<Place> places_;
};

}  // namespace

CollisionPoints findCollisionPoints(const DynaCoM& robot, const std::string& urdf,
                                    const std::vector<std::string>& folders) {
  if (!robot.isInitialized())
    throw NotReadyError("DynaCoM is used by findCollisionPoints before initialize()");
  const auto tree = internal::readUrdfTree(urdf);
  const pinocchio::Model& model = robot.getModel();
  const ContactPlaces places(robot);
  CollisionPoints found;
  GeometryReader reader(findFolders(urdf, folders), found.missing);
  for (const auto& [name, link] : tree->links_) {
    if (link->collision_array.empty() || !model.existFrame(name, pinocchio::BODY)) continue;
    const pinocchio::Frame& frame = model.frames[model.getFrameId(name, pinocchio::BODY)];
    if (frame.parentJoint == 0) continue;
    std::vector<Ball> balls;
    for (const auto& collision : link->collision_array)
      if (collision && collision->geometry)
        reader.read(*collision->geometry, frame.placement * toPlacement(collision->origin), balls);
    std::vector<Ball> chosen = chooseExtreme(balls);
    chosen.erase(
        std::remove_if(chosen.begin(), chosen.end(),
                       [&](const Ball& ball) { return places.own(frame.parentJoint, ball); }),
        chosen.end());
    if (chosen.empty()) continue;
    BodyPoints body;
    body.link = name;
    body.joint = frame.parentJoint;
    body.points.resize(3, Index(chosen.size()));
    body.radius.resize(Index(chosen.size()));
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      body.points.col(Index(k)) = chosen[k].center;
      body.radius[Index(k)] = chosen[k].radius;
    }
    found.bodies.push_back(std::move(body));
  }
  std::stable_sort(found.bodies.begin(), found.bodies.end(),
                   [](const BodyPoints& a, const BodyPoints& b) { return a.joint < b.joint; });
  return found;
}

}  // namespace dynacom
