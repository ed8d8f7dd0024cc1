#include "test/ros/cell_support.hpp"

#include <fringe_fusion/RangeView.h>
#include <ros/network.h>
#include <ros/ros.h>
#include <sensor_msgs/PointCloud2.h>
#include <sensor_msgs/point_cloud2_iterator.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>
#include <xmlrpcpp/XmlRpc.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <mutex>
#include <thread>

namespace fringe_fusion::test {

bool WaitFor(const std::function<bool()>& condition, double timeout_s) {
  using Clock = std::chrono::steady_clock;
  const auto deadline = Clock::now() + std::chrono::duration<double>(timeout_s);
  while (!condition()) {
    if (Clock::now() >= deadline) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return true;
}

bool WaitForCell(double timeout_s) {
  return WaitFor(
      [] {
        for (const char* name : {"cell_sim_node/expose", "projector_node/show_pattern",
                                 "camera_node/capture", "optimize_views", "extract_mesh"}) {
          if (!ros::service::exists(ros::names::resolve(name), false)) return false;
        }
        return true;
      },
      timeout_s);
}

pid_t NodePid(const std::string& node) {
  XmlRpc::XmlRpcValue request;
  XmlRpc::XmlRpcValue response;
  XmlRpc::XmlRpcValue payload;
  request[0] = ros::this_node::getName();
  request[1] = node;
  if (!ros::master::execute("lookupNode", request, response, payload, false)) return 0;
  std::string host;
  std::uint32_t port = 0;
  if (!ros::network::splitURI(static_cast<std::string>(payload), host, port)) return 0;
  XmlRpc::XmlRpcClient client(host.c_str(), static_cast<int>(port));
  XmlRpc::XmlRpcValue caller;
  caller[0] = ros::this_node::getName();
  if (!client.execute("getPid", caller, response) || response.size() != 3) return 0;
  return static_cast<int>(response[2]);
}

std::map<std::string, std::vector<std::string>> Subscribers() {
  XmlRpc::XmlRpcValue request;
  XmlRpc::XmlRpcValue response;
  XmlRpc::XmlRpcValue payload;
  request[0] = ros::this_node::getName();
  std::map<std::string, std::vector<std::string>> subscribers;
  if (!ros::master::execute("getSystemState", request, response, payload, true)) return subscribers;
  for (int i = 0; i < payload[1].size(); ++i) {
    std::vector<std::string>& nodes = subscribers[payload[1][i][0]];
    for (int k = 0; k < payload[1][i][1].size(); ++k) nodes.push_back(payload[1][i][1][k]);
  }
  return subscribers;
}

Process::Process(const std::vector<std::string>& arguments) {
  std::vector<char*> argv;
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  if (posix_spawnp(&pid_, argv[0], nullptr, nullptr, argv.data(), environ) != 0) pid_ = -1;
}

Process::~Process() {
  if (!Interrupt(5.0)) {
    kill(pid_, SIGKILL);
    Reap(5.0);
  }
}

bool Process::Reap(double timeout_s) {
  return WaitFor(
      [this] {
        if (pid_ < 0) return true;
        if (waitpid(pid_, &status_, WNOHANG) != pid_) return false;
        pid_ = -1;
        return true;
      },
      timeout_s);
}

bool Process::EndsWell(double timeout_s) {
  return pid_ > 0 && Reap(timeout_s) && WIFEXITED(status_) && WEXITSTATUS(status_) == 0;
}

bool Process::Interrupt(double timeout_s) {
  if (pid_ > 0) kill(pid_, SIGINT);
  return Reap(timeout_s);
}

namespace {

// The last message of a topic.
template <typename Message>
class Listener {
 public:
  Listener(ros::NodeHandle nh, const std::string& topic)
      : subscriber_(
            nh.subscribe<Message>(topic, 2, [this](const typename Message::ConstPtr& message) {
              const std::lock_guard<std::mutex> lock(mutex_);
              last_ = message;
            })) {}
  [[nodiscard]] typename Message::ConstPtr Last() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return last_;
  }
  [[nodiscard]] bool Connected() const { return subscriber_.getNumPublishers() > 0; }

 private:
  std::mutex mutex_;
  typename Message::ConstPtr last_;
  ros::Subscriber subscriber_;
};

// Distances of all points on the part to the truth at their own pixel.
ViewComparison Compare(const sensor_msgs::PointCloud2& cloud,
                       const sensor_msgs::PointCloud2& truth) {
  ViewComparison result;
  if (cloud.width != truth.width || cloud.height != truth.height) {
    result.failure = "cloud and truth differ in size";
    return result;
  }
  sensor_msgs::PointCloud2ConstIterator<float> p(cloud, "x");
  sensor_msgs::PointCloud2ConstIterator<float> t(truth, "x");
  sensor_msgs::PointCloud2ConstIterator<std::uint8_t> lit(truth, "lit");
  sensor_msgs::PointCloud2ConstIterator<std::uint8_t> on_part(truth, "on_part");
  std::vector<double> distances;
  std::size_t num_lit = 0;
  for (; p != p.end(); ++p, ++t, ++lit, ++on_part) {
    if (*lit == 0 || *on_part == 0) continue;
    ++num_lit;
    if (!std::isfinite(p[2])) continue;
    distances.push_back(std::hypot(p[0] - t[0], p[1] - t[1], p[2] - t[2]));
  }
  if (distances.empty()) {
    result.failure = "no point on the part";
    return result;
  }
  std::sort(distances.begin(), distances.end());
  result.num_points = distances.size();
  result.median_m = distances[distances.size() / 2];
  result.p95_m = distances[distances.size() * 95 / 100];
  result.complete_ratio = static_cast<double>(result.num_points) / static_cast<double>(num_lit);
  return result;
}

}  // namespace

ViewComparison ScanAndCompareView(double angle_rad, double timeout_s) {
  ros::NodeHandle nh;
  Listener<sensor_msgs::PointCloud2> cloud(nh, "points/xyzrgba");
  Listener<sensor_msgs::PointCloud2> truth(nh, "cell_sim_node/truth/points");
  Listener<RangeView> view(nh, "range_view");
  MoveClient move("move_to_view", true);
  ScanViewClient scan("scan_view", true);
  ViewComparison failed;
  const bool ready = WaitForCell(timeout_s) &&
                     WaitFor(
                         [&] {
                           return move.isServerConnected() && scan.isServerConnected() &&
                                  cloud.Connected() && truth.Connected() && view.Connected();
                         },
                         timeout_s);
  if (!ready) {
    failed.failure = "the cell is not ready";
    return failed;
  }
  MoveToViewGoal stop;
  stop.joint_positions = {angle_rad};
  move.sendGoal(stop);
  if (WaitForEnd(move, timeout_s) != "SUCCEEDED") {
    failed.failure = "move_to_view: " + move.getResult()->message;
    return failed;
  }
  ScanViewGoal goal;
  goal.scan_id = "one_view";
  scan.sendGoal(goal);
  if (const std::string state = WaitForEnd(scan, timeout_s); state != "SUCCEEDED") {
    failed.failure = "scan_view: " + state;
    if (scan.getResult()) failed.failure += ": " + scan.getResult()->message;
    return failed;
  }
  const auto first_stamp = scan.getResult()->first_stamp;
  const bool arrived = WaitFor(
      [&] {
        return cloud.Last() && cloud.Last()->header.stamp == first_stamp && truth.Last() &&
               view.Last();
      },
      timeout_s);
  if (!arrived) {
    failed.failure = "no cloud with the stamp of the first frame";
    return failed;
  }
  ViewComparison comparison = Compare(*cloud.Last(), *truth.Last());
  comparison.calibration_id = view.Last()->calibration_id;
  return comparison;
}

}  // namespace fringe_fusion::test
