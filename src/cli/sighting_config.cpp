#include "sighting_config.hpp"

namespace fringe_fusion::cli {

Result<SightingConfig> LoadSightingConfig(const Session& session) {
  const auto phase = session.LoadStage<PhaseConfig>("phase");
  if (!phase) return Forward(phase);
  const auto detect = session.LoadStage<DetectConfig>("detect");
  if (!detect) return Forward(detect);
  const auto transfer = session.LoadStage<TransferConfig>("transfer");
  if (!transfer) return Forward(transfer);
  return SightingConfig{*phase, *detect, *transfer};
}

}  // namespace fringe_fusion::cli
