// The whole system, from an installed tutti: frames without anything to see have no pose, and say so.
#include <tutti/slam/config.h>
#include <tutti/slam/slam_system.h>
#include <tutti/slam/version.h>

#include <cstdio>

int main() {
  const tutti::RunConfig config = tutti::ParseConfig("odometry:\n  features: 500\n", "inline");
  tutti::CameraRig rig;
  rig.camera.width = 320;
  rig.camera.height = 240;
  rig.camera.fx = rig.camera.fy = 300;
  rig.camera.cx = 160;
  rig.camera.cy = 120;
  tutti::SlamSystem slam(config, rig);
  for (int i = 0; i < 3; ++i) {
    tutti::InputFrame frame;
    frame.stamp_s = 0.1 * i;
    frame.image = cv::Mat::zeros(240, 320, CV_8UC1);
    if (slam.Track(frame).state == tutti::TrackingState::kTracking) return 1;
  }
  slam.Finish();
  std::printf("tutti %s: %zu poses\n", tutti::kVersion, FrameTrajectory(slam.odometry()->map()).size());
  return FrameTrajectory(slam.odometry()->map()).empty() ? 0 : 1;
}
