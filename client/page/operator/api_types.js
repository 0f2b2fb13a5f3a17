/**
 * JSON of the operator's HTTP interface as types, for the type checker. No code.
 *
 * @typedef {{median: number, worst: number}} Spread seconds
 *
 * @typedef {object} CameraPicture site pixel = camera pixel · scale + (left, top)
 * @property {number} width pixels of the camera's picture
 * @property {number} height
 * @property {number} scale
 * @property {number} left
 * @property {number} top
 *
 * @typedef {object} CameraDiagnostics an entry of /api/operator/cameras
 * @property {string} camera
 * @property {'live' | 'gone' | 'ended' | 'starting' | 'refused'} state
 * @property {string} message
 * @property {'clear' | 'covered' | 'turned' | 'blurred' | 'noisy' | 'frozen'} condition what is wrong with the picture
 * @property {number | null} condition_since unix seconds; null: nothing is wrong
 * @property {number} covered_share of the picture, by something on the lens
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
 * @property {number | null} optimal share of the windows
 * @property {number} solved_windows
 * @property {number | null} floor_offset meters; null: tracked alone
 * @property {number | null} retry_at unix seconds until which it waits to open its source again; null: it does not wait
 * @property {{text: string, at: number} | null} last_error
 * @property {CameraPicture | null} picture
 *
 * @typedef {object} SiteCamera in the configuration file
 * @property {string} camera
 * @property {string} address without passwords
 * @property {string} substream in which people are tracked, likewise; empty: the camera has none
 * @property {string} digest tells whether it has changed
 *
 * @typedef {{name: string, fps: number, width: number, height: number, digest: string}} SiteFormat /api/operator/site_settings
 *
 * @typedef {object} RestartStatus /api/operator/restart
 * @property {boolean} possible
 * @property {string} error why the configuration file cannot be used; empty: it can
 * @property {string[]} changed_keys settings of the file that are not in force
 * @property {string} refused why the last restart went back to the earlier configuration; empty: it did not
 *
 * @typedef {object} PulseClients /api/operator/pulses
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
 * @property {number} foot_points detected while another camera detected the person too
 * @property {number[]} thirds shares of them in the left, middle and right third of the picture
 * @property {number | null} depth_ratio height of the nearest over that of the farthest person, in pixels
 *
 * @typedef {object} Walk /api/operator/walk
 * @property {'none' | 'walking' | 'working' | 'done'} state
 * @property {number} seconds
 * @property {number} max_seconds maximum length of a walk
 * @property {WalkCamera[]} cameras
 * @property {{one: string, other: string, seconds: number}[]} pairs for how long both detected the person
 * @property {string[]} uncovered where to walk as well
 * @property {string} error why the calibration failed
 * @property {string[]} lines the result as text
 * @property {string} insufficient what the walk did not cover, if the result is uncertain
 * @property {string} configuration YAML; empty: there is no ground file
 *
 * @typedef {object} PointsFile marked points, as `myview calibrate` reads them
 * @property {string} unit of the floor
 * @property {Record<string, {image: [number, number], floor: [number, number], name?: string}[]>} cameras
 *
 * @typedef {object} PointsResult
 * @property {string[]} lines the report
 * @property {Record<string, {floor: number, image: number}[]>} errors by camera, of each of its points
 * @property {string} ground the text of the ground file
 * @property {string} configuration YAML
 * @property {string} plan PNG in base64; empty: it could not be drawn
 *
 * @typedef {object} MarkedPoints /api/operator/marked_points
 * @property {string | null} unit of the floor
 * @property {PointsFile['cameras']} points that the configuration's calibration was computed from
 * @property {Record<string, number[][]>} homographies of the configuration, by camera
 * @property {string} digest of that calibration
 * @property {PointsResult | null} result
 *
 * @typedef {object} ZoneRule
 * @property {string} rule its id
 * @property {string} kind entered, left, crossed, stayed, crowded or close
 * @property {string | null} direction of crossed: inward or outward; null: both
 * @property {number | null} longer_than_s of stayed
 * @property {number | null} more_than of crowded: people
 * @property {number | null} closer_than_m of close
 * @property {number | null} hold_s of crowded and close
 * @property {(number | string)[]} people empty: everybody
 * @property {string[] | null} days mon to sun; null: all
 * @property {[string, string] | null} hours HH:MM; null: all day
 * @property {string[]} cameras that must send a clear picture
 *
 * @typedef {object} SiteZone a zone in the configuration file
 * @property {string} zone its id
 * @property {string | null} camera null: on the floor, in meters or the ground's unit; else in pixels of its picture
 * @property {[number, number][] | null} area corners
 * @property {[number, number][] | null} line its two ends
 * @property {[number, number] | null} inner a point on the inner side of a line
 * @property {ZoneRule[]} rules
 *
 * @typedef {object} SiteZones /api/operator/zones
 * @property {string} unavailable why they cannot be changed; empty: they can
 * @property {boolean} in_force
 * @property {string} unit of coordinates on the floor
 * @property {SiteZone[]} zones
 * @property {ZoneRule[]} rules that are on no zone
 * @property {string} digest of zones and rules
 *
 * @typedef {object} Setting an entry of /api/operator/config
 * @property {string} key
 * @property {string} value in YAML
 * @property {string | null} default
 * @property {boolean} differs
 *
 * @typedef {object} Settings /api/operator/config
 * @property {Setting[]} settings
 * @property {string} error why the file on disk is invalid; empty: it is valid
 * @property {string[]} changed_keys keys whose values in the file are not in force
 *
 * @typedef {Record<string, number | boolean>} Values
 *
 * @typedef {object} SelectionSettings /api/operator/view_selection
 * @property {Values} values in force
 * @property {Values} file values of the configuration
 * @property {string} lines YAML for the configuration
 * @property {number} min_lookahead_s
 * @property {number} max_lookahead_s
 *
 * @typedef {object} ManualOverrides /api/operator/people
 * @property {Record<string, string>} names by number
 * @property {Record<string, number>} merged kept number by merged number
 * @property {number | null} new_object number of the person just split off
 * @property {string} unavailable why people cannot be edited; empty: they can
 *
 * @typedef {object} PersonDeletionPlan /api/operator/deletion
 * @property {number} object
 * @property {string} state planned, running or done
 * @property {number[]} objects all numbers of the person
 * @property {string | null} name
 * @property {boolean} visible
 * @property {number} events
 * @property {number} decisions recorded GOPs that mention them
 * @property {number} seen_s
 * @property {{camera: string, seen_s: number, deleted_s: number}[]} cameras
 * @property {number} sound_s
 * @property {{object: number, name: string | null, deleted_s: number}[]} others
 * @property {string[]} mentions
 */

export {};
