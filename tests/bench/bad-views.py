#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""What one bad view of six costs the picture: the built-in figure, dressed, in exact depth, view 1 made wrong in five ways.
usage: tests/bench/bad-views.py [SHEET.jpg]   in the environment of pipelines/env.sh; wants python3-opencv
Columns of the sheet: without and with rangealign, and the picture without that view.
Printed: PSNR against the picture of six right views, dB, where either is drawn."""
import os, subprocess, sys, tempfile
import cv2, numpy as np

VIEWS, BAD, AZIMUTH, SIZE, FRAMES = 6, 1, 40, 400, 16
ALL = 'poses+views+points+colours'


def launch(text):
    subprocess.run(['gst-launch-1.0', '-q', '-e'] + text.split(), check=True, timeout=300)


def export_views():
    """PNGs of depth (16 bits, 0.1 mm) and colour of all views, and the rig."""
    launch(f'avatartestsrc views={VIEWS} num-buffers=1 rig-export=rig.yaml ! video/x-range,width=320,height=240 ! fakesink')
    for i in range(VIEWS):
        launch(f'avatartestsrc views={VIEWS} view-id={i} num-buffers=1 motion=0 noise=0 dress=all '
               f'! video/x-range,width=320,height=240 ! rangesplit name=s '
               f's.depth ! queue ! pngenc ! filesink location=d{i}.png '
               f's.colour ! queue ! videoconvert ! pngenc ! filesink location=c{i}.png')


def turned_rig(millimetres, degrees):
    """rig.yaml with the bad view's pose wrong, as wrong.yaml."""
    source = cv2.FileStorage('rig.yaml', cv2.FILE_STORAGE_READ)
    pose = source.getNode('views').at(BAD).getNode('world_from_view')
    numbers = [[pose.getNode(name).at(k).real() for k in range(n)] for name, n in (('rotation', 9), ('translation', 3))]
    rotation = cv2.Rodrigues(np.radians(degrees) * np.array([0.6, 0.8, 0]))[0] @ np.array(numbers[0]).reshape(3, 3)
    translation = np.array(numbers[1]) + np.array([0.6, 0.8, 0]) * millimetres / 1000
    parts = open('rig.yaml').read().split('world_from_view:')
    tail = parts[BAD + 1]
    end = tail.index(']', tail.index('translation')) + 1
    join = lambda v: ', '.join('%.12g' % x for x in v)
    parts[BAD + 1] = f'\n         rotation: [ {join(rotation.ravel())} ]\n         translation: [ {join(translation)} ]' + tail[end:]
    open('wrong.yaml', 'w').write('world_from_view:'.join(parts))


def record(name, rig='rig.yaml', depth=lambda d: d, colour=lambda c: c):
    """NAME.rcnc: all views, the bad one with its depth and colour changed."""
    still = f'pngdec ! imagefreeze num-buffers={FRAMES} ! video/x-raw,framerate=15/1 ! videoconvert'
    for i in range(VIEWS):
        d, c = cv2.imread(f'd{i}.png', -1), cv2.imread(f'c{i}.png')
        if i == BAD:
            d, c = depth(d), colour(c)
        cv2.imwrite('d.png', d), cv2.imwrite('c.png', c)
        launch(f'rangecombine name=c depth-scale=0.0001 rig={rig} view-id={i} ! neighbourcodeenc profile=plain '
               f'! filesink location=v{i}.rcnc filesrc location=c.png ! {still} ! c.colour '
               f'filesrc location=d.png ! {still} ! c.depth')
    launch(f'rangemux name=m ! filesink location={name}.rcnc '
           + ' '.join(f'filesrc location=v{i}.rcnc ! neighbourcodeparse ! queue ! m.' for i in range(VIEWS)))


def picture(recording, corrections):
    launch(f'filesrc location={recording}.rcnc ! neighbourcodeparse ! neighbourcodedec ! rangealign corrections={corrections} '
           f'! striprender azimuth={AZIMUTH} elevation=5 background=0x00ffffff '
           f'! video/x-raw,width={SIZE},height={SIZE} ! video/x-raw,format=RGBA ! pngenc ! multifilesink location=p%02d.png')
    p = cv2.imread(f'p{FRAMES - 1:02d}.png', -1).astype(float)
    return p[..., :3] * p[..., 3:] / 255 + 255 - p[..., 3:], p[..., 3] > 127


def psnr(a, b):
    where = a[1] | b[1]
    return 10 * np.log10(65025 / max(1e-9, ((a[0] - b[0])[where] ** 2).mean()))


def main():
    sheet = os.path.abspath(sys.argv[1]) if len(sys.argv) > 1 else None
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        export_views()
        turned_rig(50, 5)
        first = cv2.imread(f'd{BAD}.png', -1)
        stranger = np.where(first > 0, first - np.minimum(first, 1500), 0).astype(np.uint16)[:, ::-1]  # 15 cm nearer, aside
        stranger = np.roll(stranger, 40, axis=1)
        holes = np.random.default_rng(1).random(first.shape) < 0.5
        record('right')
        record('without', depth=lambda d: d * 0)
        cases = {'wrong pose, 50 mm and 5 degrees': dict(rig='wrong.yaml'),
                 'mirrored colour': dict(colour=lambda c: c[:, ::-1]),
                 'exposure x 0.6': dict(colour=lambda c: (c * 0.6).round().astype(np.uint8)),
                 'half of its pixels missing': dict(depth=lambda d: np.where(holes, 0, d).astype(np.uint16)),
                 "another person's depth": dict(depth=lambda d: stranger)}
        truth, without, rows = picture('right', ALL), picture('without', ALL), []
        print(f'without that view: {psnr(without, truth):.1f} dB')
        for name, change in cases.items():
            record('bad', **change)
            before, after = picture('bad', 'none'), picture('bad', ALL)
            print(f'{name}: {psnr(before, truth):.1f} dB -> {psnr(after, truth):.1f} dB')
            rows.append(np.hstack([before[0], after[0], without[0]]))
        if sheet:
            cv2.imwrite(sheet, cv2.resize(np.vstack(rows), None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), [cv2.IMWRITE_JPEG_QUALITY, 90])


if __name__ == '__main__':
    main()
