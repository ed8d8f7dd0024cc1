// Starts the action scan_object from the command line, shows its progress and waits for its end.
#include <actionlib/client/simple_action_client.h>
#include <actionlib_msgs/GoalStatusArray.h>
#include <fringe_fusion/ScanObjectAction.h>
#include <ros/ros.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <string>

namespace {

using fringe_fusion::ScanObjectAction;
using fringe_fusion::ScanObjectFeedbackConstPtr;
using fringe_fusion::ScanObjectGoal;
using Client = actionlib::SimpleActionClient<ScanObjectAction>;

// Written by the signal handler alone, and nothing else may be done there.
volatile std::sig_atomic_t interrupted = 0;
constexpr int kInterrupted = 130;  // what shells report for a program ended by SIGINT

extern "C" void OnInterrupt(int /*signal*/) { interrupted = 1; }

void ShowFeedback(const ScanObjectFeedbackConstPtr& feedback) {
  std::printf("[%3.0f %%] %u of %u views: %s\n", 100.0 * feedback->progress, feedback->view,
              feedback->num_views, feedback->state.c_str());
  std::fflush(stdout);
}

// Cancels the goal and lets the cell stop; a second interrupt does not wait for it.
void Cancel(Client& client) {
  std::fprintf(stderr, "scan_object: cancelling, the motion stops\n");
  client.cancelGoal();
  interrupted = 0;
  for (int i = 0; i < 200 && !client.getState().isDone() && interrupted == 0; ++i) {
    ros::WallDuration(0.05).sleep();
  }
}

// Id of the goal that the cell works on; empty if it is free. A new goal would end that scan.
std::string RunningGoal() {
  const auto status = ros::topic::waitForMessage<actionlib_msgs::GoalStatusArray>(
      "scan_object/status", ros::Duration(2.0));
  if (!status) return "";
  for (const actionlib_msgs::GoalStatus& goal : status->status_list) {
    if (goal.status == actionlib_msgs::GoalStatus::ACTIVE ||
        goal.status == actionlib_msgs::GoalStatus::PENDING ||
        goal.status == actionlib_msgs::GoalStatus::PREEMPTING) {
      return goal.goal_id.id;
    }
  }
  return "";
}

int Run(const ScanObjectGoal& goal, double wait_s) {
  Client client("scan_object", /*spin_thread=*/true);
  for (double waited_s = 0.0; !client.isServerConnected(); waited_s += 0.1) {
    if (waited_s > wait_s || interrupted != 0) {
      std::fprintf(stderr,
                   "scan_object: no action server %s within %.3g s: check that the cell "
                   "is launched\n",
                   ros::names::resolve("scan_object").c_str(), wait_s);
      return 1;
    }
    ros::WallDuration(0.1).sleep();
  }
  if (const std::string running = RunningGoal(); !running.empty()) {
    std::fprintf(stderr, "scan_object: the cell is busy with goal %s: wait, or cancel it first\n",
                 running.c_str());
    return 1;
  }
  client.sendGoal(goal, Client::SimpleDoneCallback(), Client::SimpleActiveCallback(),
                  &ShowFeedback);
  bool cancelled = false;
  int away = 0;
  while (!client.getState().isDone()) {
    if (interrupted != 0) {
      Cancel(client);
      cancelled = true;
      break;
    }
    away = client.isServerConnected() ? 0 : away + 1;
    if (away > 200) {
      std::fprintf(stderr,
                   "scan_object: the cell node has gone; the frames taken so far are in "
                   "%s, resume with --resume\n",
                   goal.output_folder.c_str());
      return 1;
    }
    ros::WallDuration(0.05).sleep();
  }
  const auto result = client.getResult();
  const std::string state = client.getState().toString();
  if (state != "SUCCEEDED" || !result || result->success == 0) {
    std::fprintf(stderr, "scan_object: %s: %s\n", state.c_str(),
                 result ? result->message.c_str() : "no result");
    return cancelled ? kInterrupted : 1;
  }
  std::printf("%s; registration rms %.4f -> %.4f mm\n", result->message.c_str(),
              1e3 * result->rms_before, 1e3 * result->rms_after);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "scan_object",
            ros::init_options::AnonymousName | ros::init_options::NoSigintHandler);
  CLI::App app("Scans an object through the running cell.");
  std::uint32_t num_views = 0;
  std::string output_folder;
  std::string scan_id;
  bool resume = false;
  double wait_s = 30.0;
  app.add_option("num_views", num_views, "number of views; 0: as the cell is configured")
      ->required()
      ->check(CLI::Range(0, 100000));
  app.add_option("output_folder", output_folder, "folder for mesh, frames and figures")->required();
  app.add_option("--id", scan_id, "name of the scan; default: made from the time");
  app.add_flag("--resume", resume, "continue the interrupted scan in the output folder");
  app.add_option("--wait", wait_s, "wait for the cell [s]");
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    std::printf("%s", app.help().c_str());
    return 0;
  } catch (const CLI::ParseError& error) {
    std::fprintf(stderr, "scan_object: %s\n", error.what());
    return 2;
  }
  std::signal(SIGINT, OnInterrupt);
  std::signal(SIGTERM, OnInterrupt);
  // A master that is just being started is waited for like the cell.
  const ros::WallTime start = ros::WallTime::now();
  while (!ros::master::check()) {
    const double waited_s = (ros::WallTime::now() - start).toSec();
    if (waited_s > wait_s || interrupted != 0) {
      std::fprintf(stderr, "scan_object: no ROS master at %s within %.3g s\n",
                   ros::master::getURI().c_str(), wait_s);
      return 1;
    }
    ros::WallDuration(0.1).sleep();
  }
  ros::start();
  ScanObjectGoal goal;
  goal.scan_id = scan_id;
  goal.num_views = num_views;
  // The cell node has a working folder of its own.
  goal.output_folder = std::filesystem::absolute(output_folder).lexically_normal().string();
  goal.resume = static_cast<std::uint8_t>(resume);
  return Run(goal, wait_s);
}
