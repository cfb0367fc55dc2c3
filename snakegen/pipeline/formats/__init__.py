"""What a build can become for others: a ROS 2 package, a Menagerie folder, a USD stage."""
