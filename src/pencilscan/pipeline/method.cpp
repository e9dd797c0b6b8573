#include "pencilscan/pipeline/method.h"

#include <algorithm>
#include <array>

namespace pencilscan {

std::span<const SolutionMethod> solution_methods() {
  using Families = std::vector<ColorFamily>;
  using Graphs = std::span<const GridGraph>;
  static const std::array kMethods = std::to_array<SolutionMethod>({
      {"linear",
       {.needs_identities = true},
       LinearOptions{},
       [](const Rig& rig, const Families&, Graphs graphs, const MethodOptions&) {
         return solve_linear(rig, graphs);
       }},
      {"multiview",
       {.needs_identities = true},
       MultiviewOptions{},
       [](const Rig& rig, const Families&, Graphs graphs, const MethodOptions& options) {
         return solve_multiview(rig, graphs, std::get<MultiviewOptions>(options));
       }},
      {"joint",
       {.may_be_guided = true, .allows_dense_depth = true, .corrects_rig = true},
       JointOptions{},
       [](const Rig& rig, const Families& families, Graphs graphs, const MethodOptions& options) {
         return solve_joint(rig, families, graphs, std::get<JointOptions>(options));
       }},
      {"single-projector",
       {.needs_identities = true, .needs_grid = true},
       SingleProjectorOptions{},
       [](const Rig& rig, const Families&, Graphs graphs, const MethodOptions& options) {
         return solve_projector_grids(rig, graphs, std::get<SingleProjectorOptions>(options));
       }},
  });
  return kMethods;
}

const SolutionMethod& solution_method(const MethodOptions& options) {
  const auto methods = solution_methods();
  return *std::find_if(methods.begin(), methods.end(), [&](const SolutionMethod& m) {
    return m.defaults.index() == options.index();
  });
}

std::vector<std::string> method_names() {
  std::vector<std::string> names;
  for (const SolutionMethod& method : solution_methods()) names.emplace_back(method.name);
  return names;
}

const SolutionMethod* find_method(std::string_view name) {
  const auto methods = solution_methods();
  const auto it = std::find_if(methods.begin(), methods.end(),
                               [name](const SolutionMethod& m) { return m.name == name; });
  return it == methods.end() ? nullptr : &*it;
}

bool set_multiview_cost(std::string_view name, MethodOptions& options) {
  if (name != "published" && name != "normalized") return false;
  if (auto* multiview = std::get_if<MultiviewOptions>(&options)) {
    multiview->cost = name == "published" ? MultiviewCost::kPublished : MultiviewCost::kNormalized;
  }
  return true;
}

std::string_view broken_rule(const Rig& rig, const MethodOptions& options) {
  if (!solution_method(options).capabilities.needs_grid || shows_grid(rig)) return {};
  return "must hold one with a vertical and a horizontal pattern, which the method "
         "single-projector needs";
}

}  // namespace pencilscan
