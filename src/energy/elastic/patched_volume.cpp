// SPDX-License-Identifier: MIT
#include "patched_volume.hpp"

#include <algorithm>
#include <utility>

#include "core/parallel_reduce.hpp"
#include "energy/energy.hpp"
#include "fem/hessian_sink.hpp"
#include "fem/volume_patches.hpp"
#include "geometry/cofactors.hpp"
#include "strain.hpp"
#include "turned.hpp"

namespace itr {

namespace {

constexpr std::size_t kElements = 256, kPatches = 64;  ///< of a task

template <typename Gradient>
double volume_change(const Gradient& G) {
  return G.trace() + sum_of_minors(G);
}

}  // namespace

template <int Dim>
void add_patches(const std::map<int, Material>& materials, CellSet<Dim>& cells) {
  const auto is_averaged = [&](int body) {
    const auto it = materials.find(body);
    return it != materials.end() && it->second.volume == VolumeForm::patches;
  };
  const auto asks = [&](const auto& entry) { return is_averaged(entry.first); };
  cells.patches = std::ranges::any_of(materials, asks) ? volume_patches<Dim>(cells, is_averaged) : nullptr;
}

template <int Dim>
PatchedVolume<Dim>::PatchedVolume(const CellSet<Dim>& cells, const std::map<int, Material>& materials, double scale,
                                  RuleOf rule_of)
    : cells_(cells), scale_(scale), rule_of_(std::move(rule_of)) {
  for (const auto& [body, material] : materials)
    if (material.volume == VolumeForm::patches)
      whole_[body] =
          cells.axisymmetric ? elastic_moduli<3>(material, Vec<3>::Zero()) : elastic_moduli<Dim>(material, Vec<Dim>::Zero());
}

template <int Dim>
std::vector<double> PatchedVolume<Dim>::changes(const Displacement<Dim>& u) const {
  constexpr int kParts = VolumePatches<Dim>::kParts;
  const VolumePatches<Dim>& patches = *cells_.patches;
  const std::size_t straight = cells_.straight().size();
  const auto* shared = SharedPatches<Dim>::of(&patches);
  // Integrals of w (J - 1), or its moments, the whole last.
  std::vector<std::array<double, kParts>> of_element(cells_.elements.size());
  parallel_blocks(of_element.size(), kElements, [&](std::size_t begin, std::size_t end) {
    for (std::size_t e = begin; e < end; ++e) {
      const auto& element = cells_.elements[e];
      if (e < straight) {
        Mat<Dim> edges;
        for (int k = 0; k < Dim; ++k) edges.col(k) = u.difference(element.vertices[0], element.vertices[k + 1]);
        of_element[e].back() = element.volume * volume_change(Mat<Dim>(edges * element.inverse_edges));
        continue;
      }
      of_element[e].fill(0);
      const NodalDisplacements<Dim> displacements(element, u);
      for_each_site<Dim>(cells_, element, rule_of_(e - straight), [&](std::size_t, const auto& site) {
        const double change = volume_change(site.displacement_gradient(displacements).G);
        if (shared) {
          of_element[e].back() += site.weight(1) * change;
          for (int k = 0; k < Dim; ++k)
            of_element[e][k] += site.weight(1) * (site.point.weights[k + 1] - 1.0 / (Dim + 1)) * change;
          return;
        }
        for (int part = 0; part < kParts; ++part)
          if (patches.patch_of[e][part] != kNone)
            of_element[e][part] += site.weight(1) * patches.weight(static_cast<int>(e), part, site.point.weights) * change;
      });
    }
  });
  std::vector<double> changes(patches.count());
  if (shared) {  // of a trial, which is small
    for (std::size_t i = 0; i < changes.size(); ++i) {
      double sum = shared->outside[i];
      for (const auto& [e, share] : patches.members_of(i))
        sum += shared->shares[share].integral({of_element[e].back(), Eigen::Map<const Vec<Dim>>(of_element[e].data())});
      changes[i] = sum / patches.volume[i];
    }
    return changes;
  }
  parallel_blocks(changes.size(), kPatches, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      double sum = 0;
      for (const auto& member : patches.members_of(i)) sum += of_element[member.element][member.part];
      changes[i] = sum / patches.volume[i];
    }
  });
  return changes;
}

template <int Dim>
double PatchedVolume<Dim>::value(const std::vector<double>& changes) const {
  return scale_ * parallel_sum(changes.size(), kPatches, [&](std::size_t begin, std::size_t end) {
           double sum = 0;
           for (std::size_t i = begin; i < end; ++i) sum += cells_.patches->volume[i] * response(i, changes[i]).value;
           return sum;
         });
}

template <int Dim>
PatchPressures<Dim> PatchedVolume<Dim>::pressures(const std::vector<double>& changes) const {
  PatchPressures<Dim> result{cells_.patches.get(), {}};
  for (std::size_t i = 0; i < changes.size(); ++i) result.values.push_back(response(i, changes[i]).first);
  return result;
}

template <int Dim>
std::vector<double> PatchedVolume<Dim>::densities(const std::vector<double>& changes) const {
  std::vector<double> result;
  for (std::size_t i = 0; i < changes.size(); ++i) result.push_back(response(i, changes[i]).value);
  return result;
}

template <int Dim>
VectorX PatchedVolume<Dim>::gradient_of(std::size_t patch, ConstVectorView x) const {
  const VolumePatches<Dim>& patches = *cells_.patches;
  const auto nodes = patches.nodes_of(patch);
  const std::size_t straight = cells_.straight().size();
  const auto* shared = SharedPatches<Dim>::of(&patches);
  VectorX gradient = VectorX::Zero(Dim * static_cast<Eigen::Index>(nodes.size()));
  const auto add = [&](int node, const Vec<Dim>& force) {
    const auto place = std::lower_bound(nodes.begin(), nodes.end(), node) - nodes.begin();
    gradient.segment<Dim>(Dim * place) += force;
  };
  for (const auto& [e, part] : patches.members_of(patch)) {
    const auto& element = cells_.elements[e];
    if (static_cast<std::size_t>(e) < straight) {
      const double weight = shared ? shared->shares[part].weight : 1;
      const Mat<Dim> C = weight * element.volume * cofactors(deformation_gradient<Dim>(element, x));
      const auto gradients = barycentric_gradients<Dim>(element.inverse_edges);
      for (int k = 0; k <= Dim; ++k) add(element.vertices[k], C * gradients.col(k));
      continue;
    }
    const auto of_element = element.nodes();
    const auto positions = at_nodes<Dim>(of_element, x);
    Nodal<Dim> forces = Nodal<Dim>::Zero();
    for_each_site<Dim>(cells_, element, rule_of_(static_cast<std::size_t>(e) - straight),
                       [&, e = e, part = part](std::size_t, const auto& site) {
                         const double of_part = shared ? shared->shares[part].at(site.point.weights)
                                                       : patches.weight(e, part, site.point.weights);
                         const double weight = site.weight(1) * of_part;
                         site.add_forces(weight, cofactors(site.deformation_gradient(positions)), forces);
                       });
    for (int k = 0; k < kQuadraticNodes<Dim>; ++k) add(of_element[k], forces.col(k));
  }
  return gradient;
}

template <int Dim>
void PatchedVolume<Dim>::add_hessian(ConstVectorView x, const std::vector<double>& changes, PsdProjection psd,
                                     HessianSink& sink) const {
  const auto make = [&](std::size_t i) { return gradient_of(i, x); };
  parallel_then_ordered<VectorX>(changes.size(), kPatches, make, [&](std::size_t i, const VectorX& gradient) {
    const double second = projected(response(i, changes[i]).second, psd);
    if (second == 0) return;
    const MatrixX block = (scale_ * second / cells_.patches->volume[i]) * gradient * gradient.transpose();
    sink.add<Dim>(cells_.patches->nodes_of(i), block.data());
  });
}

template void add_patches(const std::map<int, Material>&, CellSet<2>&);
template void add_patches(const std::map<int, Material>&, CellSet<3>&);
template class PatchedVolume<2>;
template class PatchedVolume<3>;

}  // namespace itr
