/**
 * What the server says, as types: docs of the HTTP interface, checked by the editor. No code.
 *
 * A pulse is a frame number, the one time axis of a site; the media time of a frame is pulse / fps.
 *
 * @typedef {object} Site
 * @property {string} name
 * @property {number} fps frames per second
 * @property {number} width pixels of the picture that boxes are measured in
 * @property {number} height
 * @property {number} gop frames between two moments at which the camera may change
 * @property {number} lookahead_frames
 * @property {string | null} codec RFC 6381, such as avc1.42C01F, or vp8; null: no key frame has come yet
 * @property {'mp4' | 'webm'} [container] what streams are in; mp4 where it is not said
 * @property {string | null} [sound] the same of the sound, such as mp4a.40.2; null: the site has none
 * @property {number | null} pulse0 unix seconds at which pulse 0 was due; null before the first pulse
 * @property {number} now unix seconds of the server's clock
 * @property {string[]} cameras
 *
 * @typedef {object} Session what whoever looks at the page may
 * @property {boolean} by_token by a token; else there are none, and nothing to sign in to
 * @property {string | null} name of the token
 * @property {'watch' | 'operate'} role
 * @property {number | null} object this person's views alone
 * @property {string | null} camera this camera alone
 *
 * @typedef {object} Person an entry of /api/objects
 * @property {number} object
 * @property {string | null} [name] what the operator calls them
 * @property {number[]} [aliases] other numbers that this person once had
 * @property {number} first_seen pulse
 * @property {number} last_seen pulse
 * @property {boolean} visible
 * @property {string | null} camera the present choice
 * @property {string[]} cameras who sees the person now
 * @property {string | null} thumbnail
 *
 * @typedef {object} Camera an entry of /api/cameras
 * @property {string} camera
 * @property {'live' | 'gone' | 'ended' | 'starting' | 'refused'} state
 * @property {number} pulse
 * @property {number} late
 * @property {number} fps
 * @property {string} message
 *
 * @typedef {object} Cut
 * @property {number} object
 * @property {string | null} from
 * @property {string} to
 * @property {number} pulse
 *
 * @typedef {[number, number, number, number, number]} Box object, left, top, right, bottom (pixels)
 *
 * @typedef {object} Gop what is decided for the frames [first, first + frames)
 * @property {number} first pulse
 * @property {number} frames
 * @property {Record<string, string>} choices camera by object
 * @property {Record<string, Box[][]>} boxes by camera, one list per frame
 * @property {Cut[]} cuts
 * @property {{kept: number, lost: number}[]} [merged] numbers that turned out to be one person
 * @property {{kept: number, new_object: number, camera: string}[]} [split] whom a camera showed as another than they are
 *
 * @typedef {object} Flag what an operator is asked to look at
 * @property {number} id
 * @property {number[]} objects whom it is about: point at the first of them
 * @property {string[]} cameras where it is foreseen
 * @property {'crossing' | 'id_switch' | 'track_loss' | 'optimality_gap'} reason
 * @property {number} pulse when it is expected
 * @property {number} raised the newest pulse when it was raised
 * @property {number} margin by how much the tracker is sure, as a cost
 * @property {number} risk how likely it is to go wrong unless somebody helps
 * @property {'raised' | 'followed' | 'answered' | 'expired'} state
 *
 * @typedef {object} Choice /api/objects/{k}/choice
 * @property {number} object
 * @property {string | null} camera
 * @property {number} since pulse
 * @property {string} reason one plain sentence
 * @property {Record<string, number | null>} costs by camera, mean of a frame; null: it cannot be shown
 * @property {Record<string, number>} seen by camera, share of the look-ahead
 * @property {Record<string, number>} [undetected] likewise: in which it does not find them, who stand before it as others know
 * @property {Record<string, Record<string, number>>} terms by camera: what its quality is made of
 * @property {Record<string, number>} weights by term
 * @property {string | null} before the camera of the GOP before
 * @property {number | null} stay what the look-ahead costs with it
 * @property {string | null} cut_to the best other camera
 * @property {number | null} cut what the look-ahead costs with that, the cut included
 * @property {number} switch_cost frames of not seeing the person
 * @property {number} lookahead frames
 */

export {};
