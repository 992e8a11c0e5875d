"""What runs inside the Blender process that reads scene files; nothing else may import bpy."""
