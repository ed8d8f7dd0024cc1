#include "fringe_fusion/ros_io/known_parameters.hpp"

#include <algorithm>
#include <mutex>
#include <set>
#include <vector>

namespace fringe_fusion::ros_io {
namespace {

struct Registry {
  std::mutex mutex;
  std::set<std::string> names;
};

Registry& TheRegistry() {
  static Registry registry;
  return registry;
}

}  // namespace

void DeclareParameter(const std::string& resolved_name) {
  Registry& registry = TheRegistry();
  const std::lock_guard<std::mutex> lock(registry.mutex);
  registry.names.insert(resolved_name);
}

Status CheckNoUnknownParameter(const ros::NodeHandle& private_nh) {
  std::vector<std::string> names;
  if (!private_nh.getParamNames(names)) return Fail("the parameter server does not answer");
  std::sort(names.begin(), names.end());
  const std::string prefix = private_nh.getNamespace() + "/";
  Registry& registry = TheRegistry();
  const std::lock_guard<std::mutex> lock(registry.mutex);
  for (const std::string& name : names) {
    if (name.compare(0, prefix.size(), prefix) != 0 || registry.names.count(name) > 0) continue;
    if (name == prefix + "diagnostic_period") continue;  // Read by diagnostic_updater.
    return Fail(
        "parameter {} is unknown: check its spelling, or delete it if it is left from an "
        "earlier launch",
        name);
  }
  return {};
}

}  // namespace fringe_fusion::ros_io
