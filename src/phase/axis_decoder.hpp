#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "gray_fit.hpp"
#include "joint_unwrap.hpp"
#include "micro_fit.hpp"
#include "step_fit.hpp"

namespace fringe_fusion::decode {

/// How phase set number `set` of an axis joins the estimate of the sets before it.
[[nodiscard]] NestLevel LevelOf(const AxisPlan& plan, std::size_t set, const PhaseConfig& config);

/// Where an axis ends, and whether its code begins anew there.
[[nodiscard]] AxisEnds EndsOf(const AxisPlan& plan);

/// Decoded coordinates of one row.
struct AxisRow {
  explicit AxisRow(std::size_t size)
      : coordinate_px(size),
        variance_px2(size),
        log_odds(size),
        offset_dn(size),
        amplitude2_dn2(size),
        status(size),
        half_px(size) {}

  std::vector<float> coordinate_px;
  std::vector<float> variance_px2;
  std::vector<float> log_odds;  ///< of the fringe order against the others, least of all steps
  std::vector<float> offset_dn;
  std::vector<float> amplitude2_dn2;
  std::vector<std::int32_t> status;  ///< RowStatus
  std::vector<float> half_px;        ///< half of the interval that the Gray code leaves open
};

/// Decodes one axis row by row: fits every phase set, reads the Gray code, finds the fringe orders
/// by likelihood and fuses all phase sets by inverse variance. One object per thread.
/// Ref: science sections 2.1, 2.3, 2.4.
class AxisDecoder {
 public:
  AxisDecoder(const AxisPlan& plan, const DecodeContext& context);

  /// Coordinates hold their values also where status tells why they must not be used.
  const AxisRow& Run(const FrameRows& rows);

 private:
  void MergeSets();
  void DecodeGray();
  void StartNested();
  void Nest(std::size_t set);
  void DecodeJoint();
  void DecodeMicro(const FrameRows& rows);
  void Store(std::size_t x, const Unwrapped& pixel);
  void Finish();

  const AxisPlan& plan_;
  DecodeContext context_;
  float least_log_odds_ = 0.0F;  ///< of a fringe order that is not in doubt
  std::optional<GrayFit> gray_;
  std::vector<StepFit> fits_;
  std::optional<JointUnwrap> joint_;
  std::optional<MicroFit> micro_;
  AxisRow row_;
};

}  // namespace fringe_fusion::decode
