#include "tutti/slam/slam_options.h"

#include <utility>

namespace tutti {

std::string SlamOptions::Validate() const {
  if (threads < 1 || threads > 256) return "threads must be 1 to 256";
  if (loop_delay_frames < 1) return "loop_delay_frames must be at least 1";
  if (loop_every_keyframes < 1) return "loop_every_keyframes must be at least 1";
  if (!(loop_min_interval_s >= 0)) return "loop_min_interval_s must not be negative";
  if (!(loop_min_age_s >= 0)) return "loop_min_age_s must not be negative";
  if (loop_confirmations < 1) return "loop_confirmations must be at least 1";
  if (loop_confirmation_frames < 1) return "loop_confirmation_frames must be at least 1";
  if (!(loop_gate_sigmas >= 0)) return "loop_gate_sigmas must not be negative";
  if (inject_false_loops < 0) return "inject_false_loops must not be negative";
  if (covisibility_min_shared < 10) return "covisibility_min_shared must be at least 10";
  if (covisibility_edges < 0) return "covisibility_edges must not be negative";
  if (!(loop_defer_fraction >= 0)) return "loop_defer_fraction must not be negative";
  if (!(loop_defer_deg >= 0)) return "loop_defer_deg must not be negative";
  const std::pair<const char*, double> positive[] = {
      {"loop_apart_fraction", loop_apart_fraction},
      {"loop_agree_fraction", loop_agree_fraction},
      {"loop_agree_deg", loop_agree_deg},
      {"loop_agree_scale", loop_agree_scale},
      {"loop_after_fraction", loop_after_fraction},
      {"loop_after_deg", loop_after_deg},
      {"odometry_sigma_deg", odometry_sigma_deg},
      {"odometry_sigma_fraction", odometry_sigma_fraction},
      {"odometry_sigma_scale", odometry_sigma_scale},
      {"loop_sigma_deg", loop_sigma_deg},
      {"loop_sigma_fraction", loop_sigma_fraction},
      {"loop_sigma_scale", loop_sigma_scale},
  };
  for (const auto& [name, value] : positive) {
    if (!(value > 0)) return std::string(name) + " must be greater than 0";
  }
  return "";
}

}  // namespace tutti
