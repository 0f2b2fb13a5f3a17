/**
 * JSON of the HTTP interface as types, for the type checker. No code.
 *
 * A pulse is a frame number, the common time axis of a site; the media time of a frame is pulse / fps.
 *
 * @typedef {object} Site
 * @property {string} name
 * @property {number} fps frames per second
 * @property {number} width of the site's picture, the pixels of boxes
 * @property {number} height
 * @property {number} gop frames of a GOP; the camera changes only between GOPs
 * @property {number} lookahead_s
 * @property {string | null} codec RFC 6381, such as avc1.42C01F, or vp8; null: no keyframe has arrived yet
 * @property {'mp4' | 'webm'} [container] of the streams; mp4 if missing
 * @property {string | null} [h264] codec of best.mp4?codec=h264; null: the streams are H.264 themselves
 * @property {string | null} [sound] codec of the audio, such as mp4a.40.2; null: the site has none
 * @property {number | null} pulse0 Unix seconds at which pulse 0 was due; null before the first pulse
 * @property {number} now Unix seconds of the server's clock
 * @property {string[]} cameras
 * @property {string[]} [others] base URLs of the services that replace this one
 * @property {'others' | 'everybody' | null} [blur] whom the visitor sees pixelated; then there is no past, and no held camera
 *
 * @typedef {object} ViewerDelay an entry of /api/delays
 * @property {string} delay live, balanced or smooth
 * @property {number} lookahead_s
 * @property {number | null} delay_s from when a frame was due until it is sent, median; null: not measured yet
 * @property {number | null} delay_p95_s
 * @property {number | null} regret_s seconds of not seeing the person per minute, beyond the best views in hindsight
 * @property {number | null} cuts_per_minute
 *
 * @typedef {object} Session rights of the visitor
 * @property {boolean} by_token signed in by a token; false: the site needs none
 * @property {string | null} name of the token
 * @property {'watch' | 'operate'} role
 * @property {number | null} object only this person's views
 * @property {string | null} camera only this camera
 *
 * @typedef {object} Person an entry of /api/objects
 * @property {number} object
 * @property {string | null} [name] given by an operator
 * @property {number[]} [aliases] earlier numbers, merged into this one
 * @property {number} first_seen pulse
 * @property {number} last_seen pulse
 * @property {boolean} visible
 * @property {string | null} camera selected now
 * @property {string[]} cameras that see the person now
 * @property {string | null} thumbnail
 *
 * @typedef {object} PersonElsewhere an entry of /api/objects: somebody whom another service or site serves
 * @property {number} object
 * @property {string | null} server base URL
 * @property {string | null} [site] name of the other site; null: it is another service of this one
 * @property {boolean | null} [visible] whether the other site or area sees them now; null: a service that all cameras send to
 *
 * @typedef {object} Camera an entry of /api/cameras
 * @property {string} camera
 * @property {'live' | 'gone' | 'ended' | 'starting' | 'refused'} state
 * @property {number} pulse
 * @property {number} late
 * @property {number} fps
 * @property {string} message
 * @property {number | null} retry_at unix seconds until which it waits to open its source again; null: it does not wait
 * @property {'clear' | 'covered' | 'turned' | 'blurred' | 'noisy' | 'frozen'} condition what is wrong with the picture
 * @property {number | null} condition_since unix seconds; null: nothing is wrong
 * @property {number} covered_share of the picture, by something on the lens
 *
 * @typedef {object} Cut
 * @property {number} object
 * @property {string | null} from
 * @property {string} to
 * @property {number} pulse
 *
 * @typedef {[number, number, number, number, number]} Box object, left, top, right, bottom (pixels)
 *
 * @typedef {object} Gop decisions for the frames [first, first + frames)
 * @property {number} first pulse
 * @property {number} frames
 * @property {Record<string, string>} choices camera by object
 * @property {Record<string, Box[][]>} boxes by camera, one list per frame
 * @property {Cut[]} cuts
 * @property {{kept: number, lost: number}[]} [merged] numbers found to be the same person
 * @property {{kept: number, new_object: number, camera: string}[]} [split] numbers that a camera had mixed up
 *
 * @typedef {object} Flag a predicted tracking failure
 * @property {number} id
 * @property {number[]} objects the people involved; the first is the one to point at
 * @property {string[]} cameras whose trackers predict it
 * @property {'crossing' | 'id_switch' | 'track_loss' | 'optimality_gap'} reason
 * @property {number} pulse at which it is expected
 * @property {number} raised the newest pulse when it was raised
 * @property {number} margin cost difference to the tracker's second-best solution
 * @property {number} risk of a failure without an answer
 * @property {'raised' | 'followed' | 'answered' | 'expired'} state
 *
 * @typedef {object} Choice /api/objects/{k}/choice
 * @property {number} object
 * @property {string | null} camera
 * @property {number} since pulse
 * @property {string} reason one sentence
 * @property {Record<string, number | null>} costs by camera, mean per frame; null: it cannot be shown
 * @property {Record<string, number>} seen by camera, share of the look-ahead
 * @property {Record<string, number>} [undetected] by camera, share of the look-ahead in which only other cameras detect the person
 * @property {Record<string, Record<string, number>>} terms by camera and view-quality term
 * @property {Record<string, number>} weights by term
 * @property {string | null} before camera of the previous GOP
 * @property {number | null} stay_s cost of the look-ahead without a cut
 * @property {string | null} cut_to the best other camera
 * @property {number | null} cut_s cost of the look-ahead with that camera, including the cut
 * @property {number} switch_cost_s seconds of not seeing the person
 * @property {number} lookahead_s
 *
 * @typedef {object} Zone
 * @property {string} zone its id
 * @property {string | null} camera null: on the floor, in meters
 * @property {[number, number][] | null} area corners
 * @property {[number, number][] | null} line
 * @property {number[]} objects the people in an area now
 *
 * @typedef {object} RuleEvent
 * @property {string} rule its id
 * @property {string} kind entered, left, crossed, stayed, crowded or close
 * @property {string} phase once; or began and ended
 * @property {string | null} zone
 * @property {number[]} objects people
 * @property {string | null} time UTC, ISO 8601
 * @property {string | null} clip address of the best view then
 *
 * @typedef {object} Rules /api/rules
 * @property {number} units_per_meter of the floor plan
 * @property {Zone[]} zones
 * @property {RuleEvent[]} events the newest first
 *
 * @typedef {object} SearchedCamera that answered the search
 * @property {string} host
 * @property {number} port
 * @property {string} name
 * @property {string} hardware
 *
 * @typedef {object} SearchResult
 * @property {SearchedCamera[]} cameras
 * @property {string} hint why their streams cannot be asked for; empty: they can
 *
 * @typedef {object} OfferedStream of a camera
 * @property {number} key
 * @property {string} name
 * @property {string} codec
 * @property {number} width
 * @property {number} height
 * @property {number} fps
 *
 * @typedef {object} OfferedStreams the largest first
 * @property {string} error
 * @property {boolean} needs_password
 * @property {OfferedStream[]} streams
 * @property {number | null} source key of the stream proposed for viewers
 * @property {number | null} substream key of the stream proposed for tracking; null: the same
 *
 * @typedef {object} CameraTrial a camera to try: by the keys of its streams, or by its address and login
 * @property {number} [stream]
 * @property {number | null} [substream]
 * @property {string} [address]
 * @property {string} [substream_address]
 * @property {string} [user]
 * @property {string} [password]
 * @property {string} [name]
 */

export {};
