#include "apps/tutti/loops/earlier_images.h"

#include <utility>
#include <vector>

#include "apps/tutti/text_table.h"
#include "core/text_reader.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti::cli {
namespace {

constexpr const char* kHead = "image,file";

// Numbered from the first image of this run; -1 for none, and for an earlier one.
std::int64_t Own(std::int64_t id, std::int64_t first) { return id < first ? -1 : id - first; }

// The values whose location is of this run.
template <typename Value>
void KeepOwn(std::int64_t first, std::int64_t Value::*location, std::vector<Value>* values) {
  std::vector<Value> own;
  for (Value& value : *values) {
    if (value.*location < first) continue;
    value.*location -= first;
    own.push_back(std::move(value));
  }
  *values = std::move(own);
}

using Posterior = std::pair<std::int64_t, double>;

}  // namespace

EarlierImages::EarlierImages(const LoopDetector& detector, const std::string& memory) : memory_(memory) {
  if (memory_.empty()) return;
  list_ = memory_ + ".images.csv";
  first_ = detector.LastId() + 1;
  if (std::error_code ignored; std::filesystem::exists(list_, ignored)) ReadNames();
  out_.open(list_, first_ > 0 ? std::ios::app : std::ios::trunc);
  if (first_ == 0 || names_.empty()) out_ << kHead << "\n";
  if (!out_) Fail("can't be written");
}

void EarlierImages::ReadNames() {
  internal::TextReader in(list_);
  std::string line;
  while (in.Next(line)) {
    const std::size_t comma = line.find(',');
    const auto id = ParseInteger(line.substr(0, comma));
    if (line == kHead) continue;
    if (comma == std::string::npos || !id) {
      throw InputError(
          list_.string() + ":" + std::to_string(in.number()) +
          ": is no line of a list of images (number,file); remove it, and earlier images will have "
          "no names");
    }
    if (*id < first_) names_[*id] = line.substr(comma + 1);
  }
}

void EarlierImages::Fail(const char* what) const {
  throw InputError(list_.string() + ": " + what + "; is there space, and may you write there?");
}

void EarlierImages::Add(std::int64_t id, const std::filesystem::path& image) {
  if (memory_.empty()) return;
  std::error_code ignored;
  const std::filesystem::path whole = std::filesystem::absolute(image, ignored);
  out_ << id << "," << (whole.empty() ? image : whole).string() << std::endl;
  if (!out_) Fail("can't be written");
}

std::string EarlierImages::Name(std::int64_t id) const {
  const auto name = names_.find(id);
  return name != names_.end() ? name->second : "image " + std::to_string(id) + " of " + memory_;
}

void EarlierImages::Separate(LoopRow* row) const {
  if (first_ == 0) return;
  LoopResult& r = row->result;
  if (r.accepted && r.candidate < first_) {
    row->earlier = EarlierLoop{r.candidate, Name(r.candidate)};
    r.accepted = false;
    r.reason = "shows the place of an earlier run's image, " + row->earlier->file;
  }
  r.query -= first_;
  r.candidate = Own(r.candidate, first_);
  r.best = Own(r.best, first_);
  r.verification.candidate = Own(r.verification.candidate, first_);
  KeepOwn(first_, &Verification::candidate, &r.tried);
  KeepOwn(first_, &Posterior::first, &r.posterior_by_location);
  KeepOwn(first_, &CandidateEvidence::location, &r.evidence);
  for (MemberOpinion& member : r.members) {
    member.best = Own(member.best, first_);
    KeepOwn(first_, &Posterior::first, &member.posterior_by_location);
    KeepOwn(first_, &CandidateEvidence::location, &member.evidence);
  }
}

std::string EarlierLoopsCsv(const LoopRun& run) {
  std::string text = "image,file,earlier_image,earlier_file,probability,inliers\n";
  for (const LoopRow& row : run.rows) {
    if (!row.earlier) continue;
    text += std::to_string(run.Number(row.result.query)) + "," + Quoted(row.file) + "," +
            std::to_string(row.earlier->image) + "," + Quoted(row.earlier->file) +
            Formatted(",%.9g,%d\n", row.result.probability, row.result.verification.inliers);
  }
  return text;
}

}  // namespace tutti::cli
