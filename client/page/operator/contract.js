/**
 * What the operator's addresses answer, as types. No code.
 *
 * @typedef {{median: number, worst: number}} Spread seconds
 *
 * @typedef {object} OwnPicture site = own · scale + (left, top), in pixels
 * @property {number} width pixels of the camera's own picture
 * @property {number} height
 * @property {number} scale
 * @property {number} left
 * @property {number} top
 *
 * @typedef {object} CameraDiagnostics an entry of /api/operator/cameras
 * @property {string} camera
 * @property {'live' | 'gone' | 'ended' | 'starting' | 'refused'} state
 * @property {string} message
 * @property {number} pulse
 * @property {number} fps
 * @property {number} missed
 * @property {number} shed
 * @property {number} load_level
 * @property {number} late
 * @property {boolean} synchronized
 * @property {number} bad_messages
 * @property {number | null} clock_offset seconds
 * @property {Spread | null} sync_error
 * @property {Spread | null} tracking_delay
 * @property {number | null} certified share of the windows
 * @property {number} windows
 * @property {{text: string, at: number} | null} last_error
 * @property {OwnPicture | null} picture
 *
 * @typedef {object} Pulses /api/operator/pulses
 * @property {string} server
 * @property {string} error
 * @property {{name: string | null, expected: boolean, behind: number}[]} clients
 * @property {string[]} missing
 *
 * @typedef {object} FloorCamera
 * @property {string} camera
 * @property {number[][]} homography 3x3, from pixels of the site's picture to the floor
 * @property {[number, number][]} outline corners on the floor
 *
 * @typedef {object} Floor /api/operator/floor
 * @property {FloorCamera[]} cameras
 * @property {string[]} uncalibrated
 *
 * @typedef {object} WalkCamera
 * @property {string} camera
 * @property {number} foot_points feet seen while another camera saw somebody
 * @property {number[]} thirds shares of them in the left, middle and right third of the picture
 * @property {number | null} depth_ratio how many times as tall the nearest appear as the farthest
 *
 * @typedef {object} Walk /api/operator/walk
 * @property {'none' | 'walking' | 'working' | 'done'} state
 * @property {number} seconds
 * @property {number} max_seconds seconds after which nothing more is taken in
 * @property {WalkCamera[]} cameras
 * @property {{one: string, other: string, seconds: number}[]} pairs for how long both saw somebody
 * @property {string[]} uncovered where to walk, too
 * @property {string} error why nothing has come of it
 * @property {string[]} lines what has come of it
 * @property {string} insufficient what was not walked, where the result is a guess
 * @property {string} configuration lines; empty: there is no ground file
 *
 * @typedef {object} Setting an entry of /api/operator/config
 * @property {string} key
 * @property {string} value as the configuration writes it
 * @property {string | null} default
 * @property {boolean} differs
 *
 * @typedef {object} Settings /api/operator/config
 * @property {Setting[]} settings
 * @property {string} error why the file on the disk cannot be in force; empty: it can
 * @property {string[]} pending_restart keys in which it differs from what is in force
 *
 * @typedef {Record<string, number | boolean>} Values
 *
 * @typedef {object} SelectionSettings /api/operator/view_selection
 * @property {Values} values in force
 * @property {Values} file what the configuration says
 * @property {string} lines for the configuration
 * @property {number} min_lookahead frames
 * @property {number} max_lookahead frames
 *
 * @typedef {object} ByHand /api/operator/people
 * @property {Record<string, string>} names by number
 * @property {Record<string, number>} merged by number: whose it is
 * @property {number | null} new_object the number of the person who was just split off
 * @property {string} unavailable why people cannot be edited; empty: they can
 */

export {};
