# SPDX-License-Identifier: LGPL-2.1-or-later
"""usage: site-folder.py PREFIX: the folder below PREFIX in which this Python looks for modules of all users, or one like it"""
import sys
from pathlib import Path

prefix = Path(sys.argv[1])
for folder in map(Path, sys.path):
    if folder.name in ("dist-packages", "site-packages") and folder.parent.parent.parent == prefix:
        break
else:
    folder = prefix / "lib" / "python{}.{}".format(*sys.version_info) / "site-packages"
print(folder)
