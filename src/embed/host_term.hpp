// SPDX-License-Identifier: MIT
#pragma once

#include <memory>
#include <string>

#include "itr/itr.hpp"

namespace itr {

/// A program's term in one dimension; `name` is for its errors. Throws InputError (when it is asked for its Hessian) for
/// blocks of vertices that are not there.
template <int Dim>
TermFactory<Dim> as_factory(std::shared_ptr<const HostTerm> term, std::string name);

}  // namespace itr
