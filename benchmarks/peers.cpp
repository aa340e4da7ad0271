// SPDX-License-Identifier: BSD-2-Clause
#include "peers.hpp"

#include <map>
#include <stdexcept>

namespace dynacom::benchmarks {
namespace {

using Make = std::unique_ptr<Peer> (*)();

const std::map<std::string, Make>& peers() {
  static const std::map<std::string, Make> all = {
      {"eiquadprog/plain", makeEiquadprogPlain},
      {"eiquadprog/fast", makeEiquadprogFast},
      {"eiquadprog/rt", makeEiquadprogRt},
#ifdef DYNACOM_PEERS
      {"DAQP/wrench", makeDaqpForWrench},
      {"DAQP/feet", makeDaqpForFeet},
      {"PIQP/wrench", makePiqp},
      {"ProxQP/wrench", makeProxqp},
#endif
  };
  return all;
}

}  // namespace

bool hasPeer(const std::string& name) { return peers().count(name) > 0; }

std::unique_ptr<Peer> makePeer(const std::string& name) {
  if (!hasPeer(name)) throw std::invalid_argument("there is no solver '" + name + "'");
  return peers().at(name)();
}

}  // namespace dynacom::benchmarks
