"""The tuned numbers of features (see `geometry.tuning`)."""

from dataclasses import dataclass

from odom.geometry.tuning import SWEEP, in_use, tuned


# fmt: off
@dataclass(frozen=True)
class Tuning:
    """Numbers of images, corners, patches and descriptions of places."""

    # corners
    corner_border_px: int = tuned(14, unit="px", source="radius of a patch (12 px) and 2 px",
        effect="No corner is nearer to the border. Smaller: patches reach beyond the image; larger: features at the "
        "border, which tell rotation best, are lost.")
    corner_apart_px: int = tuned(10, unit="px", source=SWEEP,
        effect="No corner is nearer to another. Smaller: new corners repeat old ones; larger: gaps are not filled.")
    corner_weakest: float = tuned(4e-5, unit="grey^2 of OpenCV's cornerMinEigenVal", source=SWEEP,
        effect="A weaker corner is not used. Smaller: there are corners in noise; larger: poor scenes have too few.")
    corner_over_noise: float = tuned(1.2e-5, unit="cornerMinEigenVal of one grey level of noise",
        source="the strongest of an image of white noise, 1.1e-5",
        effect="As corner_weakest, times the variance of the image's noise. Smaller: there are corners in noise; "
        "larger: faint corners of noisy images are left out.")
    corner_over_enlarged_noise: float = tuned(4e-5, unit="cornerMinEigenVal of one grey level of noise",
        source="the strongest of an image of white noise enlarged twice or four times, 3.8e-5",
        effect="As corner_over_noise, where the image was enlarged after that noise was in it.")
    # depth_plane
    depth_share_valid: float = tuned(0.5, unit="share of 7 x 7 pixels", source=SWEEP,
        effect="A plane needs depth in at least this share. Smaller: it is fitted to too little; larger: depth with "
        "holes is not used.")
    depth_share_on_surface: float = tuned(0.85, unit="share of measured pixels", source=SWEEP,
        effect="At least this share must lie on the plane. Smaller: mixed pixels at depth edges are used; larger: "
        "rough surfaces are not.")
    depth_step: float = tuned(0.03, unit="share of the depth", source=SWEEP,
        effect="Depth that is farther off the plane lies on another surface. Smaller: steep surfaces count as edges; "
        "larger: edges count as surfaces.")
    depth_least_share: float = tuned(0.01, unit="share of the image",
        source="a Kinect close to a wall still shows some per cent",
        effect="An image with less has no depth. Smaller: noise counts as depth; larger: a view into the distance "
        "counts as blind.")
    # surface
    surface_columns: int = tuned(80, unit="cells", source="a plane is fitted to 7 x 7 px, a cell of 640 px has 8 x 8",
        effect="Surfaces are sampled in so many cells over the width of an image. Fewer: small shapes are not seen; "
        "more: following them costs more, and neighbours share the noise that counts as independent.")
    # sparse_depth
    depth_sparse_share: float = tuned(0.6, unit="share of measured pixels",
        source="`fr1_xyz` with every second pixel left out at random is tracked, with two of three it is not",
        effect="Where fewer have a measured neighbour at their side, gaps are filled. Smaller: planes are fitted to "
        "too little or not at all; larger: dense images with many holes lose edges.")
    depth_fill_spacings: float = tuned(1.1, unit="1 / sqrt(share of measured pixels)",
        source="of pixels that are measured at random, 2 % lie farther from the next, of a grid none",
        effect="A gap is filled to this distance. Smaller: gaps are left; larger: surfaces grow beyond their edges.")
    depth_fill_px: float = tuned(8.0, unit="px",
        source="`fr1_rpy_part` by lines 8 to 32 px apart, and by 1 % of its pixels",
        effect="Gaps are filled no farther. Smaller: very sparse depth is not used; larger: planes are fitted to "
        "single pixels.")
    depth_fill_apart: float = tuned(0.05, unit="share of the depth",
        source="of random depths a ninth is as near, of `fr1_rpy_part` by 1 % of its pixels nine tenths",
        effect="Gaps are filled where half of the pixels are as near to the next one in depth. Smaller: slanted "
        "surfaces count as noise; larger: a sensor's noise counts as surfaces.")
    # images: taken in the dark
    image_contrast: float = tuned(30.0, unit="grey levels (standard deviation)",
        source="below that of every recording in the light (38 to 100); `odom bench robustness --axis darkness`",
        effect="An image with less contrast is amplified to this. Smaller: dark images stay faint; larger: good ones "
        "are changed.")
    image_clean: float = tuned(3.0, unit="grey levels", source="noise of a Kinect's image, JPEG included",
        effect="Noise up to this needs no smoothing. Smaller: detail is smoothed away; larger: landmarks drown in "
        "noise.")
    image_smooth_px: float = tuned(1.0, unit="px", source="`odom bench robustness --axis darkness`",
        effect="Sigma of the smoothing. Smaller: noise is left; larger: corners are smoothed away.")
    # image_scale: images of small and of large cameras
    image_least_side_px: int = tuned(480, unit="px",
        source="tuned at 640 px; four people in the arena at 320 x 240, seeds 66 and 70 to 76",
        effect="Images whose longer side is shorter are enlarged. Smaller: before small cameras people are followed; "
        "larger: images that are good as they are cost four times the time.")
    image_most_side_px: int = tuned(1280, unit="px",
        source="tuned at 640 px; `fr1_xyz` and arena at 1280 x 960: as accurate at half the size",
        effect="Images whose longer side is as long or longer are reduced. Smaller: detail is lost that the image had; "
        "larger: landmarks are lost in quick motion and among people, and a frame costs several times the time.")
    # patches
    patch_least_contrast: float = tuned(5.0, unit="grey^2 (variance)",
        source="noise of a Kinect's image, about 2 grey levels",
        effect="A patch with less is not aligned. Smaller: patches of noise are; larger: dark scenes lose landmarks.")
    patch_least_gain: float = tuned(0.2, unit="1", source=SWEEP,
        effect="A patch must be found with at least this share of its contrast. Smaller: it matches faint texture by "
        "chance; larger: landmarks are lost when the exposure changes.")
    patch_converged_px: float = tuned(0.02, unit="px", source="a twentieth of the noise",
        effect="The alignment of a patch ends with a smaller step. Smaller: it costs more; larger: positions are "
        "rougher.")
    warp_step_px: float = tuned(4.0, unit="px", source="a third of a patch's radius",
        effect="Step of the numerical derivative of the warp. Smaller or larger: hardly anything changes.")
    warp_smallest_area: float = tuned(0.15, unit="ratio of areas", source=SWEEP,
        effect="A patch is not shrunk further. Smaller: patches are shrunk to a blur; larger: landmarks are lost "
        "when the camera backs off.")
    warp_largest_area: float = tuned(6.0, unit="ratio of areas", source=SWEEP,
        effect="A patch is not magnified further. Smaller: landmarks are lost when the camera comes near; larger: "
        "magnified blur is matched.")
    # place_descriptor
    place_features: int = tuned(1000, unit="1", source=SWEEP,
        effect="A place is described by so many. Fewer: places are not recognised; more: it costs more in the "
        "background.")
    place_fast_threshold: int = tuned(5, unit="grey levels", source=SWEEP,
        effect="A feature needs at least this contrast. Smaller: there are features in noise; larger: there are none "
        "in the dark.")
    place_scale: float = tuned(1.4, unit="ratio of sides",
        source="frames .1 to .5 s apart of fr1_rpy and a head-worn camera; at 1.2 blurred ones do not match",
        effect="Ratio from each of ORB's 8 scales to the next. Smaller: blurred places are not matched; larger: "
        "matches are less exact.")
    place_around_px: int = tuned(24, unit="px", source="bodies painted into fr1_rpy, against those painted's own mask",
        effect="Among people a place has only features this near to a landmark that stands. Smaller: few are left; "
        "larger: people are a part of places.")
# fmt: on


TUNING = in_use(Tuning)
