#include "nodes/scan_model.hpp"

#include <algorithm>
#include <utility>

namespace fringe_fusion::nodes {

Result<ScanModel> ScanModel::Create(const Configs& configs) {
  Result<ImplicitModel> model = ImplicitModel::Create(configs.fusion);
  if (!model) return Forward(model);
  const Result<OccupancyMap> map = OccupancyMap::Create(configs.occupancy);
  if (!map) return Forward(map);
  return ScanModel(configs, std::move(*model));
}

ScanModel::ScanModel(const Configs& configs, ImplicitModel model)
    : configs_(configs), model_(std::move(model)) {}

Status ScanModel::Reset(const std::string& scan_id) {
  Result<ImplicitModel> model = ImplicitModel::Create(configs_.fusion);
  if (!model) return tl::unexpected<Error>(model.error());
  model_ = std::move(*model);
  entries_.clear();
  solved_.clear();
  revision_ = 0;
  scan_id_ = scan_id;
  return {};
}

void ScanModel::Adopt(SavedModel saved) {
  model_ = std::move(saved.model);
  entries_.clear();
  solved_.clear();
  revision_ = saved.origin.pose_revision;
  scan_id_ = saved.origin.scan_id;
}

Result<ScanModel::Counts> ScanModel::Integrate(View view) {
  const int id = view.id;
  if (Holds(id)) {
    if (Status status = model_.RemoveView(id); !status) {
      return tl::unexpected<Error>(status.error());
    }
    entries_.erase(id);
  }
  const auto solved = solved_.find(id);
  if (solved != solved_.end()) view.pose = solved->second;
  Entry entry{std::move(view), {}};
  if (Status status = Rebuild(entry); !status) return tl::unexpected<Error>(status.error());
  return entries_.emplace(id, std::move(entry)).first->second.counts;
}

Status ScanModel::Repose(const std::vector<RegisteredView>& poses, std::uint32_t revision) {
  Status first_failure;
  for (const RegisteredView& registered : poses) {
    solved_[registered.id] = registered.pose;
    const auto found = entries_.find(registered.id);
    if (found == entries_.end()) {
      if (Holds(registered.id) && first_failure) {
        first_failure = Fail(
            "view {} came with a saved model and keeps its pose until it is "
            "integrated again",
            registered.id);
      }
      continue;
    }
    Entry& entry = found->second;
    const bool same =
        entry.view.pose.T_object_camera.matrix() == registered.pose.T_object_camera.matrix() &&
        entry.view.pose.covariance == registered.pose.covariance;
    entry.view.pose = registered.pose;
    if (same) continue;
    Status status = model_.RemoveView(registered.id);
    if (status) status = Rebuild(entry);
    if (!status) {
      entries_.erase(found);
      if (first_failure) first_failure = status;
    }
  }
  revision_ = revision;
  return first_failure;
}

bool ScanModel::Holds(int view_id) const {
  const std::vector<int> ids = model_.ViewIds();
  return std::binary_search(ids.begin(), ids.end(), view_id);
}

Status ScanModel::Rebuild(Entry& entry) {
  const Result<CropResult> cropped = CropView(entry.view, configs_.crop);
  if (!cropped) return tl::unexpected<Error>(cropped.error());
  entry.counts.num_points = cropped->num_kept;
  entry.counts.num_dropped =
      cropped->num_outside_box + cropped->num_on_plane + cropped->num_on_fixture;
  if (cropped->num_kept == 0) {
    return Fail("view {}: all {} points lie outside the crop box, on the plane or on the fixture",
                entry.view.id, entry.counts.num_dropped);
  }
  return model_.AddView(cropped->view);
}

std::map<int, ScanModel::Counts> ScanModel::ViewCounts() const {
  std::map<int, Counts> counts;
  for (const auto& [id, entry] : entries_) counts[id] = entry.counts;
  return counts;
}

Result<FilledSurface> ScanModel::Fill(const FillConfig& fill, const SurfaceConfig& surface) const {
  std::vector<const View*> views;
  for (const int id : model_.ViewIds()) {
    const auto found = entries_.find(id);
    if (found == entries_.end()) {
      return Fail(
          "view {} came with a saved model: nobody knows what it saw as empty, so holes stay open "
          "until it is integrated again",
          id);
    }
    views.push_back(&found->second.view);
  }
  return FillHoles(model_, views, fill, surface);
}

Result<OccupancyMap> ScanModel::Occupancy() const {
  Result<OccupancyMap> map = OccupancyMap::Create(configs_.occupancy);
  if (!map) return map;
  for (const auto& [id, entry] : entries_) {
    if (Status status = map->AddView(entry.view); !status) {
      return tl::unexpected<Error>(status.error());
    }
  }
  return map;
}

}  // namespace fringe_fusion::nodes
