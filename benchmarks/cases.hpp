// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace dynacom::benchmarks {

// What one benchmark measures.
struct Case {
  std::string name;
  // Does all that is not to be measured, and returns what is.
  std::function<std::function<void()>()> prepare;
  std::string reference = "";  // name of the case that it is measured against, if there is one
};

// Those of an executable; main.cpp runs them.
std::vector<Case> makeCases();

}  // namespace dynacom::benchmarks
