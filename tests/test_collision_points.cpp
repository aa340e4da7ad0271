// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE collision_points
#include <Eigen/Geometry>
#include <algorithm>
#include <boost/test/unit_test.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>

#include "dynacom/collision_points.hpp"
#include "dynacom/contact6d.hpp"
#include "dynacom/contact_parts.hpp"

using namespace dynacom;

namespace {

const std::string kInertial =
    "<inertial><mass value='1'/><inertia ixx='0.01' iyy='0.01' izz='0.01' ixy='0' ixz='0' "
    "iyz='0'/></inertial>";

std::string collision(const std::string& origin, const std::string& geometry) {
  return "<collision><origin " + origin + "/><geometry>" + geometry + "</geometry></collision>";
}

// A trunk that carries a leg with a foot; `trunk` is what the trunk's collision geometry is.
std::string makeUrdf(const std::string& trunk) {
  return "<robot name='toy'><link name='trunk'>" + kInertial + trunk +
         "</link><joint name='hip' type='revolute'><parent link='trunk'/><child link='leg'/>"
         "<origin xyz='0 0 -0.2'/><axis xyz='0 1 0'/>"
         "<limit lower='-1' upper='1' effort='1' velocity='1'/></joint><link name='leg'>" +
         kInertial + collision("xyz='0 0 -0.2'", "<cylinder radius='0.04' length='0.4'/>") +
         "</link><joint name='ankle' type='revolute'><parent link='leg'/><child link='foot'/>"
         "<origin xyz='0 0 -0.4'/><axis xyz='0 1 0'/>"
         "<limit lower='-1' upper='1' effort='1' velocity='1'/></joint><link name='foot'>" +
         kInertial + collision("xyz='0.02 0 -0.03'", "<box size='0.2 0.08 0.06'/>") +
         "</link><joint name='mount' type='fixed'><parent link='foot'/><child link='sole'/>"
         "<origin xyz='0.02 0 -0.06'/></joint><link name='sole'/></robot>";
}

DynaCoM makeRobot(const std::string& urdf) {
  DynaCoMSettings settings;
  settings.urdf = urdf;
  DynaCoM robot(settings);
  Contact6DSettings sole;
  sole.frame_name = "sole";
  sole.mu = 0.6;
  sole.gu = 0.02;
  sole.half_length = 0.1;
  sole.half_width = 0.04;
  robot.addContact(std::make_shared<Contact6D>(sole), "sole");
  return robot;
}

const BodyPoints* find(const CollisionPoints& found, const std::string& link) {
  for (const BodyPoints& body : found.bodies)
    if (body.link == link) return &body;
  return nullptr;
}

double reach(const BodyPoints& body, const Eigen::Vector3d& direction) {
  return ((body.points.transpose() * direction) + body.radius).maxCoeff();
}

struct Directions {
  std::mt19937 engine{7};
  std::normal_distribution<double> normal;
  Eigen::Vector3d next() {
    return Eigen::Vector3d(normal(engine), normal(engine), normal(engine)).normalized();
  }
};

}  // namespace

BOOST_AUTO_TEST_CASE(spheres_and_capsules_are_balls) {
  const std::string urdf = makeUrdf(collision("xyz='0.1 0 0'", "<sphere radius='0.15'/>") +
                                    // A capsule along y.
                                    collision("xyz='0 0.2 0' rpy='1.5707963267948966 0 0'",
                                              "<cylinder radius='0.05' length='0.3'/>") +
                                    collision("xyz='0 0.05 0'", "<sphere radius='0.05'/>") +
                                    collision("xyz='0 0.35 0'", "<sphere radius='0.05'/>"));
  const DynaCoM robot = makeRobot(urdf);
  const CollisionPoints found = findCollisionPoints(robot, urdf);
  BOOST_TEST(found.missing.empty());
  const BodyPoints* trunk = find(found, "trunk");
  BOOST_REQUIRE(trunk);
  BOOST_TEST(trunk->joint == 1u);
  Directions directions;
  for (int k = 0; k < 1000; ++k) {
    const Eigen::Vector3d d = directions.next();
    // The hull of a ball and a capsule, in closed form.
    const double exact = std::max(0.1 * d.x() + 0.15, std::max(0.05 * d.y(), 0.35 * d.y()) + 0.05);
    BOOST_TEST(reach(*trunk, d) <= exact + 1e-12);
    BOOST_TEST(reach(*trunk, d) >= exact - 0.012);
  }
}

BOOST_AUTO_TEST_CASE(a_mesh_is_represented_from_all_sides) {
  // An ellipsoid, written as a file, with points inside that do not matter.
  Directions directions;
  const Eigen::Vector3d half(0.15, 0.1, 0.06);
  std::vector<Eigen::Vector3d> vertices;
  for (int k = 0; k < 600; ++k) {
    const Eigen::Vector3d d = directions.next();
    vertices.push_back((k % 3 ? 1. : 0.5) * half.cwiseProduct(d));
  }
  const auto folder = std::filesystem::temp_directory_path() / "dynacom_collision_points";
  std::filesystem::create_directories(folder);
  {
    std::ofstream file(folder / "body.obj");
    for (const Eigen::Vector3d& v : vertices)
      file << "v " << 100. * v.x() << " " << 100. * v.y() << " " << 100. * v.z() << "\n";
    for (std::size_t k = 1; k + 2 <= vertices.size(); k += 3)
      file << "f " << k << " " << k + 1 << " " << k + 2 << "\n";
  }
  const std::string place = "xyz='0.02 0 0.1' rpy='0 0 0.3'";
  const std::string urdf = makeUrdf(
      collision(place, "<mesh filename='package://toy/body.obj' scale='0.01 0.01 0.01'/>") +
      collision("xyz='0 0 0'", "<mesh filename='package://toy/other.obj'/>"));
  std::filesystem::create_directories(folder / "toy");
  std::filesystem::copy_file(folder / "body.obj", folder / "toy" / "body.obj",
                             std::filesystem::copy_options::overwrite_existing);
  const CollisionPoints found = findCollisionPoints(makeRobot(urdf), urdf, {folder.string()});
  std::filesystem::remove_all(folder);
  const std::vector<std::string> missing = {"package://toy/other.obj"};
  BOOST_TEST(found.missing == missing, boost::test_tools::per_element());
  const BodyPoints* trunk = find(found, "trunk");
  BOOST_REQUIRE(trunk);
  BOOST_TEST(trunk->points.cols() <= 48);
  const Eigen::Matrix3d turned(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ()));
  for (int k = 0; k < 1000; ++k) {
    const Eigen::Vector3d d = directions.next();
    double farthest = -1.;
    for (const Eigen::Vector3d& v : vertices)
      farthest = std::max(farthest, d.dot(turned * v + Eigen::Vector3d(0.02, 0., 0.1)));
    BOOST_TEST(reach(*trunk, d) <= farthest + 1e-6);
    BOOST_TEST(reach(*trunk, d) >= farthest - 0.0125);
  }
}

BOOST_AUTO_TEST_CASE(what_belongs_to_a_contact_is_left_out) {
  const std::string urdf = makeUrdf(collision("xyz='0 0 0'", "<box size='0.2 0.3 0.4'/>"));
  const CollisionPoints found = findCollisionPoints(makeRobot(urdf), urdf);
  BOOST_TEST(!find(found, "foot"));
  const BodyPoints* leg = find(found, "leg");
  BOOST_REQUIRE(leg);
  // The cylinder's upper end only: its lower one is 6 cm above the sole.
  BOOST_TEST(leg->points.row(2).minCoeff() == 0., boost::test_tools::tolerance(1e-12));
  const BodyPoints* trunk = find(found, "trunk");
  BOOST_REQUIRE(trunk);
  BOOST_TEST(trunk->points.cols() == 8);
}

BOOST_AUTO_TEST_CASE(bodies_become_parts) {
  const std::string urdf = makeUrdf(collision("xyz='0 0 0'", "<box size='0.2 0.3 0.4'/>"));
  const DynaCoM robot = makeRobot(urdf);
  const CollisionPoints found = findCollisionPoints(robot, urdf);
  const PartRobot split = splitContacts(robot, found.bodies);
  BOOST_TEST(split.countContacts() == 1u);
  BOOST_TEST(split.bodies.size() == found.bodies.size());
  BOOST_TEST(split.parts[3].contact == 0u);
  BOOST_TEST(split.parts[4].contact == 1u);
  BOOST_TEST(split.parts[4].name == "body." + found.bodies[0].link + ".0");
  BOOST_TEST(split.parts[4].limb != split.parts[3].limb);
  BOOST_TEST(split.parts.back().limb != split.parts[4].limb);
  BOOST_TEST(split.robot.getKnownContacts().size() == split.parts.size());
  std::vector<BodyPoints> wrong = found.bodies;
  wrong[0].joint = 99;
  BOOST_CHECK_THROW(splitContacts(robot, wrong), std::invalid_argument);
}
