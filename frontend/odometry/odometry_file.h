// An odometry in a file that holds more than it: maps of tutti::slam.
#pragma once

#include <cstdint>
#include <functional>
#include <string_view>

#include "tutti/frontend/odometry.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti {

class OdometryFile {
 public:
  using Sink = std::function<void(std::uint32_t tag, std::string_view bytes)>;
  /// Gives all that an odometry knows to `sink`, section by section; whether to use threads, and the
  /// recorder, belong to the object that loads it. Nothing is waited for: mapping that is under way begins
  /// again where it is loaded, with the same result. A copy can be saved on another thread while its original
  /// goes on, and destroyed there. The same state gives the same bytes, except those of the times that it
  /// took (tag 104).
  static void Save(const Odometry& odometry, const Sink& sink);
  /// Takes up what Save gave, from the next sections of a file, in place of all that `odometry` knows; it
  /// then goes on exactly as the saved one would have, if the options are the same. Throws InputError for
  /// another rig, another image pyramid, or damage; `odometry` is then as it was.
  static void Load(internal::SectionReader* file, Odometry* odometry);
  /// Waits for the result, and gives it to `sink` as a section. Safe on another thread than the one that uses
  /// a copy.
  static void Save(const GlobalAdjustment& adjustment, const Sink& sink);
  /// That section, from a file; `map`: of the odometry that was saved with it. Throws InputError for damage.
  static GlobalAdjustment LoadAdjustment(const Map& map, internal::SectionReader* file);
};

}  // namespace tutti
#pragma GCC visibility pop
