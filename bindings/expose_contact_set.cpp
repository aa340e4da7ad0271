// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "dynacom/contact_set.hpp"

namespace dynacom::python {

namespace {

Section rectangle(const bp::object& lower, const bp::object& upper) {
  return Section::rectangle(toVector<2>("lower", lower), toVector<2>("upper", upper));
}

Section polygon(const bp::object& points) {
  return Section::polygon(toColumns<2>("points", points));
}

bp::object getVertices(const Section& self) {
  return toArray(Eigen::MatrixX2d(self.vertices().transpose()));
}

double supportOfSection(const Section& self, const bp::object& direction) {
  return self.support(toVector<2>("direction", direction));
}

double excessOfSection(const Section& self, const bp::object& point, double normal_force) {
  return self.excess(toVector<2>("point", point), normal_force);
}

ContactSet grasp(const bp::object& lower, const bp::object& upper) {
  return ContactSet::grasp(toVector<6>("lower", lower), toVector<6>("upper", upper));
}

double supportOfSet(const ContactSet& self, const bp::object& direction, double tolerance) {
  return self.support(toNumbers("direction", direction, static_cast<int>(self.size())), tolerance);
}

double excessOfSet(const ContactSet& self, const bp::object& force) {
  return self.excess(toNumbers("force", force, static_cast<int>(self.size())));
}

void exposeSection() {
  const bp::scope section =
      bp::class_<Section>(
          "Section",
          "A convex set in a plane, not empty: what two components of a contact's force may be at\n"
          "a normal force of 1. Section() is the point at the origin.",
          bp::init<>(bp::arg("self")))
          .def("rectangle", &rectangle, (bp::arg("lower"), bp::arg("upper")),
               "All from lower to upper, both (2,); a point where these are the same. ValueError\n"
               "unless both are finite and lower <= upper.")
          .staticmethod("rectangle")
          .def("disc", &Section::disc, bp::arg("radius"),
               "The disc around the origin. ValueError unless the radius is finite and >= 0.")
          .staticmethod("disc")
          .def("polygon", &polygon, bp::arg("points"),
               "The convex hull of points, (n, 2); an edge of two, or a vertex alone, are such,\n"
               "too. ValueError if there is none, or one is not finite.")
          .staticmethod("polygon")
          .def("facets", &Section::facets,
               (bp::arg("radius"), bp::arg("facets"), bp::arg("angle") = 0.),
               "The regular polygon around a disc: as many sides as facets, from 4 to 64, the\n"
               "first one's normal at an angle [rad] from the x axis. With four at 0 it is the\n"
               "rectangle from -radius to radius. ValueError if a number is out of its range.")
          .staticmethod("facets")
          .def("shape", &Section::shape, bp::arg("self"), "Section.Shape.")
          .def("lower", &Section::lower, bp::arg("self"), Copied(),
               "Lower corner of a rectangle, (2,); of others, of the box around them.")
          .def("upper", &Section::upper, bp::arg("self"), Copied(), "The upper one, (2,).")
          .def("radius", &Section::radius, bp::arg("self"), "Of a disc; else 0.")
          .def("vertices", &getVertices, bp::arg("self"),
               "Of a polygon, counter-clockwise, (n, 2), two at least; of others none, (0, 2).\n"
               "Rectangles along the axes are no polygons, however they were made.")
          .def("support", &supportOfSection, (bp::arg("self"), bp::arg("direction")),
               "The largest product of a direction, (2,), with a point of the section: its\n"
               "support function.")
          .def("excess", &excessOfSection,
               (bp::arg("self"), bp::arg("point"), bp::arg("normal_force")),
               "By how much a point, (2,), is outside, at the normal force that makes the section\n"
               "as many times larger: the largest of its inequalities, each with a normal of\n"
               "length 1; <= 0 inside.")
          .def("to_string", &Section::to_string, bp::arg("self"), "As it is printed.")
          .def(bp::self == bp::self)
          .def(bp::self != bp::self)
          .def(PrintVisitor<Section>([](const Section& self) { return self.to_string(); }))
          .def(CopyVisitor<Section>());

  bp::enum_<Section::Shape>("Shape", "What a section is.")
      .value("Rectangle", Section::Shape::Rectangle)
      .value("Disc", Section::Shape::Disc)
      .value("Polygon", Section::Shape::Polygon)
      .attr("__reduce__") = bp::make_function(&reduceEnum);
}

}  // namespace

void exposeContactSet() {
  exposeSection();

  const bp::scope set =
      bp::class_<ContactSet>(
          "ContactSet",
          "The convex set of the forces lambda that a contact can give, in its surface's frame: "
          "of\n"
          "points (f_x, f_y, f_z) [N], of surfaces and grasps (f_x, f_y, f_z, t_x, t_y, t_z) [N],\n"
          "[N·m]. ContactSet() is a frictionless point.\n\n"
          "Of points and surfaces, the normal force f_z is between its bounds, lo <= f_z <= hi, "
          "and\n"
          "(f_x, f_y) in f_z F, the friction; of surfaces, (t_x, t_y) in f_z P, the moments of a\n"
          "force at the places of the surface, and |t_z| <= gamma f_z. Of grasps, each component "
          "is\n"
          "between bounds of its own. Equations (24) to (26) in docs/equations.md.",
          bp::init<>(bp::arg("self")))
          .def("point", &ContactSet::point, bp::arg("friction"),
               "friction: F, a Section; a disc of radius mu is Coulomb's cone.")
          .staticmethod("point")
          .def("surface", &ContactSet::surface,
               (bp::arg("friction"), bp::arg("places"), bp::arg("gamma")),
               "friction: F; places: where pressure may be [m], both a Section: P is that, turned\n"
               "by -90 degrees; gamma: [m]. ValueError unless gamma is finite and >= 0.")
          .staticmethod("surface")
          .def("grasp", &grasp, (bp::arg("lower"), bp::arg("upper")),
               "lower, upper: bounds of each component, (6,), infinite where there is none.\n"
               "ValueError if one is NaN, or lower > upper.")
          .staticmethod("grasp")
          .def("boundNormalForce", &ContactSet::boundNormalForce,
               (bp::arg("self"), bp::arg("least"), bp::arg("greatest")),
               "Of points and surfaces: bounds of f_z [N]; at first these are 0 and infinity.\n"
               "ValueError unless 0 <= least <= greatest, and least is finite, or if it is a "
               "grasp.")
          .def("kind", &ContactSet::kind, bp::arg("self"), "ContactSet.Kind.")
          .def("size", &ContactSet::size, bp::arg("self"), "Components of lambda: 3 or 6.")
          .def("friction", &ContactSet::friction, bp::arg("self"), Copied(), "F, a copy.")
          .def("moments", &ContactSet::moments, bp::arg("self"), Copied(), "P, a copy.")
          .def("gamma", &ContactSet::gamma, bp::arg("self"), "Of the yaw friction [m].")
          .def("lower", &ContactSet::lower, bp::arg("self"), Copied(),
               "Lower bounds of each component, (6,); of points and surfaces, of the third only.")
          .def("upper", &ContactSet::upper, bp::arg("self"), Copied(), "Upper ones, (6,).")
          .def("isCone", &ContactSet::isCone, bp::arg("self"),
               "Whether the set is a cone: points and surfaces without bounds.")
          .def("support", &supportOfSet,
               (bp::arg("self"), bp::arg("direction"), bp::arg("tolerance") = 0.),
               "The largest product of a direction, (size(),), with a force of the set, which may\n"
               "be infinite: the set's support function. tolerance: what of the rate at which the\n"
               "value grows with f_z is rounding.")
          .def("excess", &excessOfSet, (bp::arg("self"), bp::arg("force")),
               "By how much a force, (size(),), is outside: the largest of the inequalities, with\n"
               "normals of length 1 in their sections; <= 0 inside.")
          .def("to_string", &ContactSet::to_string, bp::arg("self"), "As it is printed.")
          .def(bp::self == bp::self)
          .def(bp::self != bp::self)
          .def(PrintVisitor<ContactSet>([](const ContactSet& self) { return self.to_string(); }))
          .def(CopyVisitor<ContactSet>());

  bp::enum_<ContactSet::Kind>("Kind", "What a contact is.")
      .value("Point", ContactSet::Kind::Point)
      .value("Surface", ContactSet::Kind::Surface)
      .value("Grasp", ContactSet::Kind::Grasp)
      .attr("__reduce__") = bp::make_function(&reduceEnum);
}

}  // namespace dynacom::python
