// SPDX-License-Identifier: BSD-2-Clause
// With flags that change Eigen's alignment this must not compile.
#include "dynacom/errors.hpp"
