#include "fringe_fusion/surface/fuse_views.hpp"

#include <chrono>
#include <utility>

namespace fringe_fusion {
namespace {

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

Result<std::vector<View>> CropAll(const std::vector<View>& views, const CropConfig& config,
                                  FusionFigures& figures) {
  std::vector<View> kept;
  for (const View& view : views) {
    Result<CropResult> crop = CropView(view, config);
    if (!crop) return Forward(crop);
    figures.num_points += crop->num_kept;
    figures.num_outside_box += crop->num_outside_box;
    figures.num_on_plane += crop->num_on_plane;
    figures.num_on_fixture += crop->num_on_fixture;
    // A view that saw nothing but the turntable is no error; one that never had a point is, and
    // AddViews says so.
    const int num_dropped = crop->num_outside_box + crop->num_on_plane + crop->num_on_fixture;
    if (crop->num_kept == 0 && num_dropped > 0) {
      ++figures.num_empty_views;
      continue;
    }
    kept.push_back(std::move(crop->view));
  }
  if (kept.empty()) {
    return Fail(
        "fusion: no point of {} views remains after cropping ({} outside the box, {} on "
        "the plane, {} on the fixture)",
        views.size(), figures.num_outside_box, figures.num_on_plane, figures.num_on_fixture);
  }
  return kept;
}

}  // namespace

Result<FusedSurface> FuseViews(const std::vector<View>& views, const FusionConfig& fusion,
                               const CropConfig& crop, const SurfaceConfig& surface,
                               const Progress& progress) {
  if (views.empty()) return Fail("fusion: no views");
  FusionFigures figures;
  const Result<std::vector<View>> cropped = CropAll(views, crop, figures);
  if (!cropped) return Forward(cropped);
  figures.num_views = static_cast<int>(cropped->size());

  Result<ImplicitModel> model = ImplicitModel::Create(fusion);
  if (!model) return Forward(model);
  const auto start = std::chrono::steady_clock::now();
  if (Status status = model->AddViews(*cropped, progress); !status) return Forward(status);
  figures.integrate_s = SecondsSince(start);
  figures.num_blocks = model->NumBlocks();
  figures.memory_bytes = model->MemoryBytes();
  figures.views = CompareViews(*model);

  const auto extract_start = std::chrono::steady_clock::now();
  Result<Mesh> mesh = ExtractMesh(*model, surface, progress);
  if (!mesh) return Forward(mesh);
  figures.extract_s = SecondsSince(extract_start);
  return FusedSurface{std::move(*model), std::move(*mesh), figures};
}

}  // namespace fringe_fusion
