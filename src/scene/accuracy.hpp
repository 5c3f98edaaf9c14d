// SPDX-License-Identifier: MIT
// /accuracy: what follows from the error that a scene asks for (docs/theory.md, "Accuracy").
#pragma once

#include "itr/scene.hpp"
#include "itr/setup.hpp"
#include "node.hpp"

namespace itr::scene {

/// Parts of the error that sources may have. They sum to 1.
struct AccuracyShares {
  double mesh = 0.6, time = 0.25, dhat = 0.1, friction = 0.05;
};

/// Reads /accuracy of a checked scene and puts what follows from it into the document, where that leaves it open. Throws
/// InputError where errors of such a scene cannot be estimated.
Accuracy apply_accuracy(Document& document);

/// Chooses what depends on bodies: d-hat and the tolerance of remeshing. Throws InputError for the name of no result.
template <int Dim>
void apply_accuracy(const Node& root, Accuracy& accuracy, Setup<Dim>& setup);

}  // namespace itr::scene
