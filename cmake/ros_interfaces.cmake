find_package(catkin REQUIRED COMPONENTS
  actionlib actionlib_msgs camera_info_manager cv_bridge diagnostic_updater dynamic_reconfigure
  geometry_msgs image_transport message_generation nodelet pluginlib rosbag roscpp sensor_msgs
  std_msgs std_srvs tf2 tf2_eigen tf2_ros visualization_msgs)

add_message_files(FILES
  CalibrationPose.msg CalibrationResidual.msg CalibrationState.msg CaptureFinding.msg
  DecodedView.msg Frame.msg IntrinsicsSigma.msg PatternDescription.msg PatternList.msg RangeView.msg
  StageState.msg ViewPose.msg ViewPoses.msg ViewStatus.msg)
add_service_files(FILES
  Capture.srv ExtractSurface.srv IntegrateView.srv LoadSequence.srv OptimizeViews.srv
  QueryDistance.srv ReadModel.srv SelfCalibrate.srv ShowPattern.srv SimExpose.srv SimPlace.srv SimProject.srv
  SolveRelativePose.srv SolveViewPose.srv SuggestSettings.srv WriteModel.srv)
add_action_files(FILES
  CalibrateCell.action CalibrateHandEye.action CalibrateTurntable.action MoveToView.action ScanObject.action ScanView.action)
generate_messages(DEPENDENCIES actionlib_msgs geometry_msgs sensor_msgs std_msgs
  LANGS gencpp genpy)
generate_dynamic_reconfigure_options(config/Camera.cfg)

catkin_package(
  INCLUDE_DIRS include
  LIBRARIES fringe_fusion_core fringe_fusion_ros
  CATKIN_DEPENDS actionlib actionlib_msgs camera_info_manager cv_bridge diagnostic_updater
    dynamic_reconfigure geometry_msgs image_transport message_runtime nodelet pluginlib rosbag
    roscpp sensor_msgs std_msgs std_srvs tf2 tf2_eigen tf2_ros visualization_msgs
  DEPENDS EIGEN3)

find_package(PkgConfig REQUIRED)
pkg_check_modules(ARAVIS REQUIRED IMPORTED_TARGET aravis-0.8)
