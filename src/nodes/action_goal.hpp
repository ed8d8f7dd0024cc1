#pragma once

#include <actionlib/client/simple_action_client.h>
#include <ros/callback_queue.h>
#include <ros/node_handle.h>

#include <chrono>
#include <functional>
#include <string>

#include "fringe_fusion/common/progress.hpp"
#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion::nodes {

/// A handle whose callbacks wait in a queue of their own.
inline ros::NodeHandle WithQueue(ros::NodeHandle nh, ros::CallbackQueue& queue) {
  nh.setCallbackQueue(&queue);
  return nh;
}

/// How long to wait for what.
struct GoalLimits {
  double server_timeout_s = 10.0;  ///< a server that is away for longer counts as lost
  double result_timeout_s = 60.0;
};

/// Runs one goal to its end. Whatever happens, no goal is left running: on a cancel, a lost server
/// or a timeout it is cancelled.
/// @param queue the client's own callback queue, worked off here and nowhere else: a client whose
///   news come in another thread can miss those that overtake the return of sendGoal.
/// @param cancelled asked all the time.
/// @return result of a success; error naming the action otherwise.
template <typename Result_, typename Client, typename Goal>
[[nodiscard]] Result<Result_> RunGoal(Client& client, ros::CallbackQueue& queue, const Goal& goal,
                                      const std::string& name, const GoalLimits& limits,
                                      const std::function<bool()>& cancelled) {
  using Clock = std::chrono::steady_clock;
  const auto seconds = [](double s) { return std::chrono::duration<double>(s); };
  const auto work_off_news = [&queue] { queue.callAvailable(ros::WallDuration(0.02)); };
  const auto start = Clock::now();
  auto last_connected = start;
  work_off_news();
  while (!client.isServerConnected()) {
    if (cancelled()) return Fail("{}", kCancelled);
    if (Clock::now() - start > seconds(limits.server_timeout_s)) {
      return Fail("action {} has no server within {:.3g} s: check that its node runs", name,
                  limits.server_timeout_s);
    }
    work_off_news();
  }
  client.sendGoal(goal);
  const auto sent = Clock::now();
  while (!client.getState().isDone()) {
    std::string failure;
    const auto now = Clock::now();
    if (client.isServerConnected()) last_connected = now;
    if (cancelled()) failure = kCancelled;
    if (now - last_connected > seconds(limits.server_timeout_s)) {
      failure = fmt::format("action {}: its node has been gone for {:.3g} s", name,
                            limits.server_timeout_s);
    } else if (now - sent > seconds(limits.result_timeout_s)) {
      failure = fmt::format("action {}: no result within {:.3g} s", name, limits.result_timeout_s);
    }
    if (!failure.empty()) {
      client.cancelGoal();
      // The server gets the chance to stop before anything else is done.
      for (int i = 0; i < 100 && !client.getState().isDone() && client.isServerConnected(); ++i) {
        work_off_news();
      }
      return Fail("{}", failure);
    }
    work_off_news();
  }
  const auto result = client.getResult();
  const std::string state = client.getState().toString();
  if (!result || state != "SUCCEEDED" || result->success == 0) {
    const std::string words = result ? result->message : "";
    return Fail("action {} ended as {}{}{}", name, state, words.empty() ? "" : ": ", words);
  }
  return Result_(*result);
}

}  // namespace fringe_fusion::nodes
