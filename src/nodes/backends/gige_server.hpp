#pragma once

#include <functional>
#include <memory>
#include <string>

#include "fringe_fusion/capture/image_stack.hpp"
#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion::nodes {

struct GigeServerConfig {
  std::string interface;    ///< address of the network interface, e.g. 127.0.0.1; empty: off
  std::string serial;       ///< serial number that the camera announces
  double lost_ratio = 0.0;  ///< probability that a data packet is lost; 0: off

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("interface", interface);
    field("serial", serial);
    field("lost_ratio", lost_ratio, 0.0, 1.0);
  }
};

/// Serves pictures as a software-triggered GigE Vision camera (Aravis' simulated one), so that the
/// simulated cell is reached over the protocol that real cameras speak.
class GigeServer {
 public:
  /// Makes one picture; runs in the server's own thread.
  using Expose = std::function<Result<CapturedFrame>(double exposure_s)>;

  /// @return error when the interface does not exist or another camera occupies it.
  [[nodiscard]] static Result<std::unique_ptr<GigeServer>> Start(const GigeServerConfig& config,
                                                                 Expose expose);
  GigeServer(const GigeServer&) = delete;
  GigeServer& operator=(const GigeServer&) = delete;
  ~GigeServer();

 private:
  struct Impl;
  explicit GigeServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace fringe_fusion::nodes
