// JSON that runs leave: any bytes give figures that can be put into tables, or an InputError. The first byte
// chooses: a run's summary.json, or what a map says of the run that made it.
#include <string>
#include <vector>

#include "apps/run/runner.h"
#include "apps/tutti/comparison.h"
#include "apps/tutti/files.h"
#include "tests/fuzz/memory_file.h"
#include "tutti/core/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  try {
    if (data[0] % 2 == 0) {
      std::vector<tutti::cli::RunFigures> runs;
      runs.push_back(tutti::cli::ReadRunFigures(tutti::fuzz::MemoryFile(data + 1, size - 1)));
      runs.push_back(runs.back());
      runs.back().sample.start += runs.back().sample.start < 100 ? 1 : -1;
      tutti::cli::DescribeComparison(runs, tutti::cli::TableFormat::kText);
      tutti::cli::JsonText(tutti::cli::ComparisonJson(runs));
    } else {
      const std::string note(reinterpret_cast<const char*>(data) + 1, size - 1);
      tutti::DatasetOfNote(note);
      tutti::RequestOf(note, "fuzz");
    }
  } catch (const tutti::InputError&) {
  }
  return 0;
}
