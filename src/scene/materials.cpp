// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <optional>
#include <sstream>
#include <string_view>
#include <utility>

#include "defaults.hpp"
#include "eigenstrain.hpp"
#include "energy/elastic/law_table.hpp"
#include "energy/polyfem/ideal_cell.hpp"
#include "function.hpp"
#include "law_reader.hpp"
#include "readers.hpp"
#include "rigid.hpp"

namespace itr::scene {

namespace {

class MaterialReader {
 public:
  /// `is_polyfem`: as PolyFEM, which has invariants of two dimensions in 2D. `has_patches`: nearly incompressible bodies
  /// average their volume.
  MaterialReader(const Node& node, int dimension, bool is_polyfem, bool has_patches)
      : node_(node), dimension_(dimension), has_patches_(has_patches) {
    const LawName& law = read_law(node, false);
    material_.law = law.law;
    if (law.law == MaterialLaw::mooney_rivlin)
      read_mooney_rivlin();
    else if (law.law == MaterialLaw::own)
      read_sum(law, is_polyfem ? dimension : 3);
    else if (node.has("elasticity_tensor"))
      read_tensor(is_polyfem);
    else if (node.has("lambda") || node.has("mu"))
      read_lame();
    else
      read_moduli();
    // An isotropic law is the same in all directions.
    if ((law.law == MaterialLaw::linear || law.law == MaterialLaw::saint_venant_kirchhoff) && has_axes(node))
      read_axes(node, dimension);
    read_eigenstrain(node, dimension, material_);
    require("rho", read_scalar(node["rho"], 1), is_positive, "a number > 0");
    material_.density = requirements_.back().value.constant;
    material_.density_at = requirements_.back().value.function;
    if (node.has("prony")) read_prony(node["prony"]);
    if (node.has("mullins")) read_mullins(node["mullins"]);
  }

  /// At the barycenters of the elements that have the material.
  Material checked(const std::vector<Vec<3>>& points, std::vector<std::string>& warnings) const {
    for (const Requirement& requirement : requirements_)
      if (requirement.value.function)
        for (const Vec<3>& X : points) requirement.check(X);
    const auto largest = [&](const SpaceFunction& f, double constant) {
      if (!f) return constant;
      double most = -1;
      for (const Vec<3>& X : points) most = std::max(most, f(X));
      return most;
    };
    Material material = material_;
    if (lambda_) set_lame(points, material, warnings);
    // Remeshing and quadrature ask at other points than these.
    const auto guard = [&](SpaceFunction& f) {
      if (!f) return;
      f = [f, requirements = requirements_](const Vec<3>& X) {
        for (const Requirement& requirement : requirements)
          if (requirement.value.function) requirement.check(X);
        return f(X);
      };
    };
    guard(material.youngs_modulus_at);
    guard(material.poisson_ratio_at);
    guard(material.density_at);
    material.youngs_modulus = largest(material.youngs_modulus_at, material.youngs_modulus);
    material.poisson_ratio = largest(material.poisson_ratio_at, material.poisson_ratio);
    material.density = largest(material.density_at, material.density);
    material.volume = read_volume(material);
    return material;
  }

 private:
  void require(const char* key, ScalarValue value, bool (*is_met)(double), const char* expected) {
    requirements_.push_back(requirement_of(node_[key], std::move(value), is_met, expected));
  }

  VolumeForm read_volume(const Material& material) const {
    static const std::vector<std::string> forms = {"pointwise", "patches"};
    const Node volume = node_["volume"];
    const bool by_default = has_patches_ && is_nearly_incompressible(material, dimension_);
    const auto form = static_cast<VolumeForm>(volume.choice(forms, by_default ? 1 : 0));
    if (form == VolumeForm::patches && !may_average_volume(material, dimension_))
      volume.fail("\"patches\" for a law without a part U(det F), with moduli that vary, or in plane stress",
                  "\"pointwise\" there");
    return form;
  }

  void read_prony(const Node& prony) {
    if (const std::string why = why_not_viscous(material_, dimension_); !why.empty())
      prony.fail("viscoelasticity of " + why, "a law and a plane that have a deviator in space");
    const auto read = [&](const char* key) {
      std::vector<double> numbers;
      for (const Node& item : prony[key].items()) numbers.push_back(item.positive(1));
      if (numbers.empty()) prony[key].fail("a list of numbers > 0");
      return numbers;
    };
    const std::vector<double> shares = read("g"), times = read("tau");
    if (times.size() != shares.size())
      prony["tau"].fail("a list of length " + std::to_string(times.size()), "that of g: " + std::to_string(shares.size()));
    double sum = 0;
    for (std::size_t i = 0; i < shares.size(); ++i) {
      material_.prony.push_back({shares[i], times[i]});
      sum += shares[i];
    }
    if (!(sum < 1)) prony["g"].fail("shares of a sum below 1, by which the moduli relax");
    if (prony["long_term"].boolean(false)) material_.deviator = 1 / (1 - sum);
  }

  void read_mullins(const Node& mullins) {
    if (const std::string why = why_not_softening(material_, dimension_); !why.empty())
      mullins.fail("softening of " + why,
                   "a law and a plane that have an isochoric part in space, without prony and eigenstrain");
    const auto read = [&](const char* key) {
      const double value = mullins.has(key) ? mullins[key].number(0) : -1;
      if (!(value >= 0)) mullins[key].fail("a number >= 0");
      return value;
    };
    const MullinsSoftening read_values{read("r"), read("m"), read("beta")};
    if (!(read_values.r > 1)) mullins["r"].fail("a number > 1");
    if (read_values.m + read_values.beta == 0) mullins["m"].fail("a number > 0 where beta is 0");
    material_.mullins = read_values;
  }

  ScalarValue read_required(const char* key) const {
    if (!node_.has(key)) node_[key].fail("a number");
    return read_scalar(node_[key], 0);
  }

  double read_number(const char* key) const {
    const ScalarValue value = read_required(key);
    if (value.function) node_[key].fail("a constant: E, nu, lambda, mu and rho may vary");
    return value.constant;
  }

  void read_moduli() {
    const ScalarValue E = read_required("E"), nu = read_required("nu");
    material_.youngs_modulus = E.constant;
    material_.poisson_ratio = nu.constant;
    material_.youngs_modulus_at = E.function;
    material_.poisson_ratio_at = nu.function;
    read_plane_strain();
    require("E", E, is_positive, "a number > 0");
    require("nu", nu, is_poisson_ratio, "a number of (-1, 0.5)");
  }

  void read_plane_strain() {
    material_.plane_strain = node_["plane_strain"].boolean(false);
    if (material_.plane_strain && dimension_ == 3)
      node_["plane_strain"].fail("true in " + in_space(node_), "it in a plane only");
  }

  void read_lame() {
    if (node_.has("E") || node_.has("nu")) node_.fail("E and nu, or lambda and mu, not both");
    for (const char* key : {"lambda", "mu"})
      if (!node_.has(key)) node_[key].fail("both of lambda and mu");
    read_plane_strain();
    lambda_ = read_required("lambda");
    mu_ = read_required("mu");
    require("mu", *mu_, is_positive, "a number > 0");
    const bool in_plane = dimension_ == 2 && !material_.plane_strain;
    // A multiple of the bulk modulus over a positive number, so that the check has one value to show.
    const auto bulk = [lambda = *lambda_, mu = *mu_, in_plane](const Vec<3>& X) {
      return in_plane ? lambda(X) + mu(X) : 3 * lambda(X) + 2 * mu(X);
    };
    const bool varies = lambda_->function || mu_->function;
    require("lambda", {bulk(Vec<3>::Zero()), varies ? SpaceFunction(bulk) : SpaceFunction()}, is_positive,
            in_plane ? "lambda + mu > 0" : "3 lambda + 2 mu > 0");
  }

  /// Whether lambda and mu are those of no material in plane stress: its nu would be 0.5 or more.
  bool is_beyond_plane_stress(const std::vector<Vec<3>>& points) const {
    const auto is_beyond = [&](const Vec<3>& X) { return (*lambda_)(X) >= 2 * (*mu_)(X); };
    if (!lambda_->function && !mu_->function) return is_beyond(Vec<3>::Zero());
    return std::any_of(points.begin(), points.end(), is_beyond);
  }

  /// Sets E and nu that give lambda and mu back: energies take these as they are given.
  void set_lame(const std::vector<Vec<3>>& points, Material& material, std::vector<std::string>& warnings) const {
    if (dimension_ == 2 && !material.plane_strain && is_beyond_plane_stress(points)) {
      material.plane_strain = true;
      const std::string text =
          node_["lambda"].pointer() + ": of 2 mu or more, which no material has in plane stress: taken as plane strain";
      if (std::find(warnings.begin(), warnings.end(), text) == warnings.end()) warnings.push_back(text);
    }
    const bool is_plane_stress = dimension_ == 2 && !material.plane_strain;
    const auto poisson = [lambda = *lambda_, mu = *mu_, is_plane_stress](const Vec<3>& X) {
      return lambda(X) / (is_plane_stress ? lambda(X) + 2 * mu(X) : 2 * (lambda(X) + mu(X)));
    };
    const auto young = [mu = *mu_, poisson](const Vec<3>& X) { return 2 * mu(X) * (1 + poisson(X)); };
    if (lambda_->function || mu_->function) {
      material.youngs_modulus_at = young;
      material.poisson_ratio_at = poisson;
    } else {
      material.youngs_modulus = young(Vec<3>::Zero());
      material.poisson_ratio = poisson(Vec<3>::Zero());
    }
  }

  /// Moduli, and the E and nu of small strains: those of shear 2 (c1 + c2) and bulk k + 2 d1.
  void read_mooney_rivlin() {
    MooneyRivlinModuli& m = material_.mooney_rivlin;
    const bool has_three = node_["type"].string("") == "MooneyRivlin3Param";
    m.c1 = read_number("c1");
    m.c2 = read_number("c2");
    (has_three ? m.volume_d : m.log_k) = read_number(has_three ? "d1" : "k");
    if (has_three) m.c3 = read_number("c3");
    const double shear = 2 * (dimension_ == 3 ? m.c1 + m.c2 : m.c1 - m.c3), bulk = m.log_k + 2 * m.volume_d;
    if (!(shear > 0)) node_["c1"].fail(dimension_ == 3 ? "c1 + c2 > 0" : "c1 - c3 > 0 (in 2D the second invariant is 1)");
    if (!(bulk > 0)) node_[has_three ? "d1" : "k"].fail("a number > 0");
    material_.youngs_modulus = 9 * bulk * shear / (3 * bulk + shear);
    material_.poisson_ratio = (3 * bulk - 2 * shear) / (2 * (3 * bulk + shear));
  }

  /// The sum, and E and nu of small strains without fibres.
  void read_sum(const LawName& law, int invariants) {
    std::vector<Requirement> requirements;
    LawSum sum = read_sum_of_laws(node_, law, dimension_, invariants, requirements);
    const auto [shear, bulk] = rest_moduli(sum);
    const auto refuse = [&](const char* what, double found) {
      std::ostringstream text;
      text << "a " << what << " modulus of " << found / node_.document().units.factor("Pa") << " at rest";
      node_.fail(text.str(), "one > 0" + std::string(law.row ? "" : " of the sum"));
    };
    if (!(shear > 0)) refuse("shear", shear);
    const bool is_conformal = is_polyfem_set(Node(node_.document())) && is_amips(sum);
    if (!(bulk > 0) && !is_conformal) refuse("bulk", bulk);
    material_ = material_of(sum, dimension_);
    if (is_conformal) {  // E and nu are scales here, and no bulk modulus gives them
      material_.poisson_ratio = 0;
      material_.youngs_modulus = 2 * shear;
    }
    if (is_of_ideal_cell(material_)) ask_for_each_place();
    if (is_of_ideal_cell(material_) && node_.has("eigenstrain"))
      node_["eigenstrain"].fail("it in AMIPS without a rest pose", "no such key");
    const auto has_share = [](const LawSum::Term& term) { return static_cast<bool>(term.share); };
    if (std::any_of(sum.terms.begin(), sum.terms.end(), has_share)) {
      material_.own_at = [own = std::static_pointer_cast<const LawSum>(material_.own)](double t) {
        auto at_t = std::make_shared<LawSum>(*own);
        at_t->time = t;
        return at_t;
      };
      ask_for_each_place();
    }
    for (Requirement& requirement : requirements) {
      if (requirement.value.function) ask_for_each_place();
      requirements_.push_back(std::move(requirement));
    }
  }

  /// Whether it is AMIPS with a rest pose and nothing else, which costs no energy where a body grows without distortion.
  static bool is_amips(const LawSum& sum) {
    return std::ranges::all_of(sum.terms,
                               [](const LawSum::Term& term) { return std::string_view(term.row->type) == "AMIPS"; });
  }

  /// A modulus that varies makes everybody ask for the law of each place.
  void ask_for_each_place() {
    material_.youngs_modulus_at = [E = material_.youngs_modulus](const Vec<3>&) { return E; };
  }

  void read_tensor(bool is_polyfem) {
    const MatrixX C = read_stiffness(node_, dimension_, is_polyfem);
    material_ =
        tensor_material(has_axes(node_) ? turned(C, read_axes(node_, dimension_)) : C, material_.law == MaterialLaw::linear);
  }

  Node node_;
  int dimension_;
  bool has_patches_;
  Material material_;
  std::vector<Requirement> requirements_;
  std::optional<ScalarValue> lambda_, mu_;  ///< instead of E and nu
};

/// Barycenters of a body's elements.
template <int Dim>
std::map<int, std::vector<Vec<3>>> barycenters_by_body(const Mesh<Dim>& mesh) {
  std::map<int, std::vector<Vec<3>>> points;
  for (CellId c = 0; c < mesh.cell_slots(); ++c) {
    Vec<3> sum = Vec<3>::Zero();
    for (const int v : mesh.cell(c)) sum.template head<Dim>() += mesh.rest(v);
    points[mesh.body(c)].push_back(sum / (Dim + 1));
  }
  return points;
}

template <int Dim>
std::vector<int> elements_of(const Mesh<Dim>& mesh, int body) {
  std::vector<int> elements;
  for (CellId c = 0; c < mesh.cell_slots(); ++c)
    if (mesh.body(c) == body) elements.push_back(c);
  return elements;
}

/// The bodies of an entry. A number that no cell has is one of a list for several meshes; a name that nothing has is wrong.
template <typename Bodies>
std::vector<std::pair<Label, int>> ids_of(const Node& entry, const LabelIds& bodies, const Bodies& of_mesh) {
  std::vector<std::pair<Label, int>> ids;
  const auto add = [&](const Label& label) {
    for (const int id : bodies.of(label)) ids.emplace_back(label, id);
    if (bodies.of(label).empty() && !of_mesh.contains(label.number)) ids.emplace_back(label, label.number);
  };
  for (const Node& id : entry["id"].items()) {
    const Label label = id.json().is_string() ? read_label(id, 0) : Label{id.integer(0)};
    if (!label.name.empty() && bodies.of(label).empty()) bodies.refuse(id, label, "the id of a body: ");
    add(label);
  }
  if (!entry.has("id")) add({0});
  return ids;
}

}  // namespace

LawSum read_law_sum(const Node& node, int dimension) {
  const LawName& law = read_law(node, false);
  if (law.law != MaterialLaw::own) node["type"].fail("a law from Yeoh on (docs/theory.md, \"Sums of laws\")");
  std::vector<Requirement> requirements;
  return read_sum_of_laws(node, law, dimension, dimension, requirements);
}

/// Whether remeshing, if there is any, carries patches: on linear elements, and where energies of trials decide. By default
/// neither in 3D nor under pressure nor with inertia, for what that costs (docs/theory.md, "Patches under remeshing").
static bool carries_patches(const Node& root, int dimension) {
  const Node space = root["space"], remesh = space["remesh"], conditions = root["boundary_conditions"];
  if (!remesh["enabled"].boolean(false)) return true;
  if (dimension == 3 || (root.has("time") && !root["time"]["quasistatic"].boolean(false))) return false;
  if (!conditions["pressure_boundary"].items().empty() || !conditions["pressure_cavity"].items().empty()) return false;
  return (!space["discr_order"].exists() || space["discr_order"].json() == 1) &&
         !remesh["curve"]["enabled"].boolean(false) && !remesh["sizing_field"]["enabled"].boolean(false) &&
         !(remesh["screening"].exists() && remesh["screening"].json() == "energy-percentile");
}

template <int Dim>
std::map<int, Material> read_materials(const Node& root, const LabelIds& bodies, const Mesh<Dim>& mesh,
                                       std::vector<std::string>& warnings) {
  const Node node = root["materials"];
  const std::set<int> rigid = rigid_ids(root, bodies);
  auto points = barycenters_by_body(mesh);
  std::erase_if(points, [&](const auto& of_body) { return rigid.contains(of_body.first); });
  if (!node.exists()) {
    if (points.empty()) return {};
    node.fail("the materials of the bodies");
  }
  const bool has_inertia = root.has("time") && !root["time"]["quasistatic"].boolean(false);
  for (const Node& entry : node.items())
    if ((has_inertia || root["boundary_conditions"].has("rhs")) && !entry.has("rho"))
      warnings.push_back(entry["rho"].pointer() + ": not given, so it is 1 kg/m^3");
  const bool is_polyfem = is_polyfem_set(root);
  // Quadratic tetrahedra do without: their patches have 65 nodes, which takes several times as long at equal error.
  const Node order = root["space"]["discr_order"];
  const bool is_cheap = Dim == 2 || !order.exists() || order.json() == 1;
  const bool has_patches = averages_volume(root) && is_cheap && carries_patches(root, Dim);
  const int space = is_axisymmetric(root) ? 3 : Dim;
  std::map<int, Material> materials;
  if (!node.json().is_array()) {  // one for everything, whatever its id
    MaterialReader reader(node, space, is_polyfem, has_patches);
    for (const auto& [body, of_body] : points) materials[body] = reader.checked(of_body, warnings);
    return materials;
  }
  std::map<int, Label> first_label;
  for (const Node& entry : node.items()) {
    MaterialReader reader(entry, space, is_polyfem, has_patches);
    std::vector<std::pair<Label, int>> ids = ids_of(entry, bodies, points);
    const auto of_rigid = std::erase_if(ids, [&](const auto& of_label) { return rigid.contains(of_label.second); });
    if (of_rigid > 0 && ids.empty())
      warnings.push_back(entry.pointer() + ": of a rigid body, whose mass /geometry/*/rigid says: it has no effect");
    for (const auto& [label, id] : ids) {
      const auto of_body = points.find(id);
      const Material material = reader.checked(of_body == points.end() ? std::vector<Vec<3>>{} : of_body->second, warnings);
      const auto [first, is_new] = first_label.emplace(id, label);
      if (!is_new && first->second != label)
        entry.fail("a second material, of \"" + text_of(label) + "\", for elements " + list_ids(elements_of(mesh, id)) +
                       ", which are in \"" + text_of(first->second) + "\" too",
                   "one for every body");
      if (!materials.insert_or_assign(id, material).second)
        warnings.push_back(entry.pointer() + ": replaces the material before it of id " + text_of(label));
    }
  }
  for (const auto& [body, of_body] : points)
    if (!materials.contains(body))
      node.fail("no material with the id " + std::to_string(body) + ", which elements " + list_ids(elements_of(mesh, body)) +
                    " have",
                "one for every body");
  return materials;
}

template std::map<int, Material> read_materials(const Node&, const LabelIds&, const Mesh<2>&, std::vector<std::string>&);
template std::map<int, Material> read_materials(const Node&, const LabelIds&, const Mesh<3>&, std::vector<std::string>&);

}  // namespace itr::scene
