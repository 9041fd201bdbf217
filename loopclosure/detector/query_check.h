// What a query must be: misuse is refused with a message before anything changes.
#pragma once

#include <cstdint>
#include <vector>

#include "loopclosure/memory/member.h"
#include "tutti/loopclosure/detector.h"

namespace tutti::internal {

/// The caller's own descriptors, which are of one kind in all images.
struct CallersDescriptors {
  int type = -1;  ///< of cv::Mat, -1: there were none yet
  int width = 0;  ///< [values]
};

/// Throws InputError for an id that can't follow `last_id` (-1: it is the first one). `file`: the long-term
/// memory that may have it from an earlier process; empty: none.
void CheckId(std::int64_t id, std::int64_t last_id, const std::string& file = {});

/// Throws InputError for features, depth, mask, cameras or a prior that make no sense by themselves, or that
/// are not for these members; or for descriptors of another kind than those `before`.
void CheckQuery(const LoopQuery& query, const std::vector<Member>& members, const CallersDescriptors& before);

}  // namespace tutti::internal
