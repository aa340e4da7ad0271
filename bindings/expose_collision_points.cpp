// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "dynacom/collision_points.hpp"

namespace dynacom::python {

namespace {

std::shared_ptr<BodyPoints> makeBody(const std::string& link, Index joint, const bp::object& points,
                                     const bp::object& radius) {
  const auto body = std::make_shared<BodyPoints>();
  body->link = link;
  body->joint = joint;
  body->points = toColumns<3>("points", points);
  body->radius = toNumbers("radius", radius, static_cast<int>(body->points.cols()));
  internal::requireSize("radius", body->radius.size(), body->points.cols(), "points");
  return body;
}

std::shared_ptr<CollisionPoints> makePoints(const bp::object& bodies, const bp::object& missing) {
  return std::make_shared<CollisionPoints>(
      CollisionPoints{toVectorOf<BodyPoints>(bodies), toVectorOf<std::string>(missing)});
}

bp::list getBodies(const CollisionPoints& found) { return toList(found.bodies); }
bp::list getMissing(const CollisionPoints& found) { return toList(found.missing); }

struct BodyPickle : bp::pickle_suite {
  static bp::tuple getinitargs(const BodyPoints& body) {
    return bp::make_tuple(body.link, body.joint, Rows<&BodyPoints::points>::get(body), body.radius);
  }
};

struct PointsPickle : bp::pickle_suite {
  static bp::tuple getinitargs(const CollisionPoints& found) {
    return bp::make_tuple(getBodies(found), getMissing(found));
  }
};

std::string writeBody(const BodyPoints& body) {
  return internal::concat("BodyPoints(link='", body.link, "', joint=", body.joint,
                          ", points=", body.points.cols(), ")");
}

std::string writePoints(const CollisionPoints& found) {
  return internal::concat("CollisionPoints(bodies=", found.bodies.size(),
                          ", missing=", toText(found.missing), ")");
}

CollisionPoints find(const DynaCoM& robot, const std::string& urdf, const bp::object& folders) {
  return findCollisionPoints(robot, urdf, toVectorOf<std::string>(folders));
}

}  // namespace

void exposeCollisionPoints() {
  bp::class_<BodyPoints, std::shared_ptr<BodyPoints>>(
      "BodyPoints",
      "Where a link of a robot may touch something besides the contacts: balls, of which\n"
      "some have the radius 0.",
      bp::no_init)
      .def("__init__",
           bp::make_constructor(
               &makeBody, bp::default_call_policies(),
               (bp::arg("link"), bp::arg("joint"), bp::arg("points"), bp::arg("radius"))),
           "link: its name; joint: index of the joint that moves it; points: centres of the balls\n"
           "in the joint's frame, (N, 3) [m]; radius: of each, (N,) [m].")
      .def_readonly("link", &BodyPoints::link, "Its name")
      .def_readonly("joint", &BodyPoints::joint, "Index of the joint that moves it")
      .add_property("points", &Rows<&BodyPoints::points>::get,
                    "Centres of the balls, in the joint's frame, (N, 3) [m]")
      .add_property("radius", getter(&BodyPoints::radius), "Of each ball, (N,) [m]")
      .def_pickle(BodyPickle())
      .def(PrintVisitor<BodyPoints>(&writeBody))
      .def(CopyVisitor<BodyPoints>());

  bp::class_<CollisionPoints, std::shared_ptr<CollisionPoints>>(
      "CollisionPoints", "Of findCollisionPoints.", bp::no_init)
      .def("__init__", bp::make_constructor(&makePoints, bp::default_call_policies(),
                                            (bp::arg("bodies"), bp::arg("missing"))))
      .add_property("bodies", &getBodies, "The BodyPoints of each link that has some")
      .add_property("missing", &getMissing,
                    "Meshes that are not there or cannot be read, as the URDF names them")
      .def_pickle(PointsPickle())
      .def(PrintVisitor<CollisionPoints>(&writePoints))
      .def(CopyVisitor<CollisionPoints>());

  bp::def(
      "findCollisionPoints", &find,
      (bp::arg("robot"), bp::arg("urdf"), bp::arg("folders") = bp::list()),
      "The CollisionPoints of a robot, a DynaCoM, from the collision geometry of its URDF, a\n"
      "path or XML: of each link a few extreme points, so that in whatever direction a link is\n"
      "looked at, one of them is within 0.01 m of the farthest, unless that takes more than 48.\n"
      "Left out is what lies within 0.12 m of a contact's surface, on its joint or one that\n"
      "carries or is carried by it. folders: where packages are looked for, besides the file's\n"
      "folder and those around it. Raises ValueError if the URDF cannot be read; meshes that\n"
      "cannot are listed as missing. Raises NotReadyError before initialize().");
}

}  // namespace dynacom::python
