"""What runs inside the Blender process, and only there: nothing else may import bpy."""
