"""Files of a case: what strangers get, as the formats say."""

import struct

import h5py
import numpy as np
import yaml


def test_strangers_get_what_the_formats_say(bowed):
    secret, staged, folder = bowed
    names = {p.name for p in folder.iterdir()}
    assert names == {"a.h5", "b.h5", "plate-1.h5", "plate-2.h5", "part.stl", "sensor.yaml"}
    sheet = yaml.safe_load((folder / "sensor.yaml").read_text())
    assert [e["name"] for e in sheet["effects"]] == [
        "camera_occlusion", "finite_spot", "edge_mixing", "incidence_noise",
    ]  # fmt: skip
    with h5py.File(folder / "a.h5") as file:
        assert file.attrs["format"] == "profilometer-recording"
        assert file["depth"].dtype == np.float32
        assert file["depth"].shape[1] == sheet["points_per_profile"]
        pose = file["pose"][:]
        turn = pose[:, :3, :3]
        np.testing.assert_allclose(turn @ turn.transpose(0, 2, 1), np.eye(3)[None] + 0 * turn,
                                   atol=1e-12)  # fmt: skip
        assert (np.diff(file["time"][:]) > 0).all()
        depth = file["depth"][:]
        middle, half = sheet["working_distance_mm"], sheet["z_range_mm"] / 2
        assert np.nanmax(np.abs(depth - middle)) <= half
    stl = (folder / "part.stl").read_bytes()
    assert struct.unpack("<I", stl[80:84])[0] == len(staged.on.nominal.faces)
    assert len(stl) == 84 + 50 * len(staged.on.nominal.faces)
    # nothing but the recordings themselves may tell that a bow was hidden
    text = (folder / "sensor.yaml").read_bytes() + stl[:80]
    assert b"bow" not in text
